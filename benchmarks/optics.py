"""Figure of merit of this project's optics and of its peers on the same cases, side by side.

Run it as ``python benchmarks/optics.py [--cases NAME ...] [--peers NAME ...] [--csv FILE] [--quick]``.
"""

from __future__ import annotations

import argparse
import csv
import gc
import importlib
import math
import os
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from cases import CASES, Case, Estimator, Unsuitable
from harness import Result, Truth, repeat, samples_for, truth_of
from peers import ours

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
"""Name -> module in `peers` and the arguments of its ``prepare`` besides the case."""
FEWEST_RUNS = 16
COLUMNS = ("case", "system", "error/run", "bias", "Z", "s/run", "set-up s", "FoM", "x ours", "")
_LINE = "{:18} {:25} {:>9} {:>9} {:>6} {:>7} {:>8} {:>9} {:>8}  {}"


def main() -> None:
    """Parse the command line, run, print."""
    parser = _parser()
    options = parser.parse_args()
    if options.runs < FEWEST_RUNS:
        parser.error(f"argument --runs: at least {FEWEST_RUNS} are needed to tell a variance")
    quick = options.quick
    names = options.cases or (["plate-1.05"] if quick else list(CASES))
    peers = options.peers if options.peers is not None else list(PEERS)
    runs, seconds = (FEWEST_RUNS, 0.02) if quick else (options.runs, options.seconds)
    print(f"{runs} runs of about {seconds:g} s each on {os.cpu_count()} cores, after a warm-up that is not counted.")
    print(f"A figure of merit of one taxel is known to {math.sqrt(2 / (runs - 1)):.0%} (one sigma).")
    print(_LINE.format(*COLUMNS))
    rows = [row for name in names for row in rows_of(CASES[name], peers, runs, seconds)]
    if options.csv:
        with options.csv.open("w", newline="") as file:
            csv.writer(file).writerows([COLUMNS, *rows])


def rows_of(case: Case, peers: list[str], runs: int, seconds: float) -> list[tuple[object, ...]]:
    """Rows of the table for one case, printed as they come; ours first."""
    truth = truth_of(case, 2 * runs * seconds)
    systems: dict[str, Callable[[Case], Estimator]] = {
        **{name: partial(ours.prepare, integrator=name) for name in ours.INTEGRATORS},
        **{name: partial(_prepare_peer, PEERS[name]) for name in peers},
    }
    rows: list[tuple[object, ...]] = []
    reference = math.nan
    for name, prepare in systems.items():
        try:
            result, set_up = _run(partial(prepare, case), truth, runs, seconds)
        except Unsuitable as reason:
            print(f"{case.name:18} {name:25} left out: {reason}", flush=True)
            continue
        if name == REFERENCE:
            reference = result.figure_of_merit
        rows.append(_row(case.name, name, result, set_up, reference))
        print(_LINE.format(*rows[-1]), flush=True)
    return rows


def _run(prepare: Callable[[], Estimator], truth: Truth, runs: int, seconds: float) -> tuple[Result, float]:
    """Outcome of a system's runs, and the seconds until its first small answer (loading, compilation)."""
    gc.collect()  # a live scene adds its plugins to the kernels of every other
    start = time.perf_counter()
    estimate = prepare()
    estimate(1 << 10, 0)
    set_up = time.perf_counter() - start
    return repeat(estimate, samples_for(estimate, seconds), runs, truth), set_up


def _prepare_peer(peer: tuple[str, dict[str, str]], case: Case) -> Estimator:
    module, arguments = peer
    try:
        return importlib.import_module(f"peers.{module}").prepare(case, **arguments)
    except ModuleNotFoundError as error:
        raise Unsuitable(f"{error.name} is not installed") from error


def _row(case: str, system: str, result: Result, set_up: float, reference: float) -> tuple[object, ...]:
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


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Figure of merit of the optics against peers.")
    parser.add_argument("--cases", nargs="+", choices=list(CASES), metavar="NAME", help=", ".join(CASES))
    parser.add_argument("--peers", nargs="*", choices=list(PEERS), metavar="NAME", help=", ".join(PEERS))
    parser.add_argument("--runs", type=int, default=32, help=f"independent seeds, at least {FEWEST_RUNS} (default 32)")
    parser.add_argument("--seconds", type=float, default=0.5, help="about how long one run is (default 0.5)")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the table here as well")
    parser.add_argument("--quick", action="store_true", help="short runs of plate-1.05: a look whether it works")
    return parser


if __name__ == "__main__":
    main()
