"""Comparison of the optics of this package with other programs on the same cases, by the figure of merit 1 / (variance
x time)."""

from __future__ import annotations

import gc
import importlib
import math
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from mitsuba_taxel.base.arguments import refusal
from mitsuba_taxel.evidence.peers import ours
from mitsuba_taxel.evidence.peers.cases import CASES, Estimator, PeerCase, UnsupportedCase
from mitsuba_taxel.evidence.peers.harness import PeerResult, TruthEstimate, repeat, samples_for, truth_of

REFERENCE = "taxel_tracer"
"""The system against which ratios are taken; it always runs first."""
PEERS = {
    "mitsuba-path": ("mitsuba_stock", {"integrator": "path", "sampler": "independent"}),
    "mitsuba-path-multijitter": ("mitsuba_stock", {"integrator": "path", "sampler": "multijitter"}),
    "mitsuba-ptracer": ("mitsuba_stock", {"integrator": "ptracer", "sampler": "independent"}),
    "radiance": ("radiance", {}),
    "embree-numpy": ("embree", {}),
    "raysect": ("raysect_path", {}),
}
"""By name of a peer: its module in `peers`, and the arguments of ``prepare`` besides the case."""
COLUMNS = ("case", "system", "error/run", "bias", "Z", "s/run", "set-up s", "FoM", "x ours", "")


def table(cases: Sequence[str], peers: Sequence[str], runs: int, seconds: float) -> Iterator[tuple[str, ...]]:
    """Run all programs on all cases, and yield rows with the columns :data:`COLUMNS`.

    Parameters
    ----------
    cases, peers : sequence of str
        Names from :data:`CASES` and :data:`PEERS`; all if empty. The peer ``none`` selects no peer.
    runs : int
        Number of runs of each program, with independent seeds.
    seconds : float
        Approximate wall time of one run, in s.

    Raises
    ------
    InputError
        if a name is unknown.
    """
    for parameter, names, allowed in (("case", cases, [*CASES]), ("peer", peers, [*PEERS, "none"])):
        for name in names:
            if name not in allowed:
                raise refusal(parameter, name, f"one of {', '.join(allowed)} is needed")
    systems = [name for name in peers or PEERS if name != "none"]
    for name in cases or CASES:
        yield from rows_of(CASES[name], systems, runs, seconds)


def rows_of(case: PeerCase, peers: Sequence[str], runs: int, seconds: float) -> Iterator[tuple[str, ...]]:
    """Run all programs on one case, and yield a row for each; this package comes first.

    Parameters
    ----------
    case : PeerCase
        The case.
    peers : sequence of str
        Names from :data:`PEERS`; the row of a peer that does not support the case has the reason.
    runs : int
        Number of runs of each program, with independent seeds.
    seconds : float
        Approximate wall time of one run, in s.
    """
    truth = truth_of(case, 2 * runs * seconds)
    systems: dict[str, Callable[[PeerCase], Estimator]] = {
        **{name: partial(ours.prepare, integrator=name) for name in ours.INTEGRATORS},
        **{name: partial(_prepare_peer, PEERS[name]) for name in peers},
    }
    reference = math.nan
    for name, prepare in systems.items():
        try:
            result, set_up = _run(partial(prepare, case), truth, runs, seconds)
        except UnsupportedCase as reason:
            yield case.name, name, *[""] * (len(COLUMNS) - 3), f"left out: {reason}"
            continue
        if name == REFERENCE:
            reference = result.figure_of_merit
        yield _row(case.name, name, result, set_up, reference)


def _run(prepare: Callable[[], Estimator], truth: TruthEstimate, runs: int, seconds: float) -> tuple[PeerResult, float]:
    """Run one program. Returns the result of its runs, and the seconds until its first small result (loading,
    compilation)."""
    gc.collect()  # a live scene adds its plugins to the kernels of every other
    start = time.perf_counter()
    estimate = prepare()
    estimate(1 << 10, 0)
    set_up = time.perf_counter() - start
    return repeat(estimate, samples_for(estimate, seconds), runs, truth), set_up


def _prepare_peer(peer: tuple[str, dict[str, str]], case: PeerCase) -> Estimator:
    module, arguments = peer
    try:
        return importlib.import_module(f"mitsuba_taxel.evidence.peers.{module}").prepare(case, **arguments)
    except ModuleNotFoundError as error:
        raise UnsupportedCase(f"{error.name} is not installed") from error


def _row(case: str, system: str, result: PeerResult, set_up: float, reference: float) -> tuple[str, ...]:
    return (
        case,
        system,
        f"{100 * result.error:.2g} %",
        f"{100 * result.bias:+.1g} %",
        f"{result.z:+.1f}",
        f"{result.seconds:.2f}",
        f"{set_up:.1f}",
        f"{result.figure_of_merit:.2g}",
        f"{result.figure_of_merit / reference:.3g}",
        "" if result.agrees else "DISAGREES with the truth",
    )
