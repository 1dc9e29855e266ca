"""A Prony series of the measured pad's silicone, fitted to the voltage after release, and the hysteresis loops that it
predicts."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.optimize import least_squares

from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.measured.bench_pad import IndenterPress
from mitsuba_taxel.evidence.measured.bench_pad_in_time import HOLD_TIMES, Prony, cycle, hold_and_release
from mitsuba_taxel.evidence.measured.pad_comparison import FINER
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies

TIMES = (0.05, 0.5, 5.0)
"""Relaxation times in s, one per decade of the measured times after release. Their weights are fitted."""
SETTLED = 0.03
"""Relative change of the weights below which the fit ends."""
MOST_PATHS = 5
FRICTION = 0.3
"""Coefficient of friction of the indenter in an additional run, which shows its effect."""
SLOW = np.geomspace(1.0, 1e4, 81)
"""Relaxation times in s that are tried for an additional term."""


class HysteresisLoop(NamedTuple):
    """Widths of the hysteresis loops of a loading cycle in percent of the largest force or change, and the energy loss
    in percent of the energy of loading.

    Attributes
    ----------
    force : float
        Width of the loop of the force, at equal travel.
    energy : float
        Energy loss of the cycle.
    change_at_force, change_at_travel : float
        Widths of the loop of the reading, at equal force and at equal travel.
    """

    force: float
    energy: float
    change_at_force: float
    change_at_travel: float


class MemoryErrors(NamedTuple):
    """Numerical errors of the predictions in a `PronyFit`, due to finite elements (from a finer mesh), time steps and
    light.

    Attributes
    ----------
    tail : (8,) ndarray
        Errors of ``PronyFit.tail``, at the times `measured.TAIL_TIMES` after release.
    hold : (4,) ndarray
        Errors of ``PronyFit.hold``, in the four time windows of the hold.
    held_change : float
        Error of ``PronyFit.held_change``.
    loop : HysteresisLoop
        Errors of ``PronyFit.loop``.
    """

    tail: np.ndarray
    hold: np.ndarray
    held_change: float
    loop: HysteresisLoop


class PronyFit(NamedTuple):
    """A Prony series fitted to the voltage after release, and the predictions of this series.

    Attributes
    ----------
    terms : tuple[tuple[float, float], ...]
        Weights and relaxation times in s of the series.
    paths : int
        Number of finite-element load paths that the fit needed.
    tail : (8,) ndarray
        Change of the pressed taxel's reading from rest, at the eight times after release at which the voltage was
        measured (`measured.TAIL_TIMES`), relative to the change at the end of the hold.
    hold : (4,) ndarray
        Mean force in the four time windows of the hold, relative to the last window.
    held_change : float
        How much the reading still drifts while the pad is held. The change of the pressed taxel's reading from rest is
        compared with its value at the end of the hold. This is the largest difference from 0.5 s on, divided by the
        value at the end.
    loop, rubbed : HysteresisLoop
        Hysteresis loops of the slow cycle: with the series, and with friction of the indenter instead of the series.
    stiffer : float
        Largest force of the cycle with friction, relative to that of the cycle with the series.
    errors : MemoryErrors
        Numerical errors of the predictions.
    """

    terms: Prony
    paths: int
    tail: np.ndarray
    hold: np.ndarray
    held_change: float
    loop: HysteresisLoop
    rubbed: HysteresisLoop
    stiffer: float
    errors: MemoryErrors


def results(store: PaperStudies, press: IndenterPress, late: float) -> PronyFit:
    """Fit a Prony series to the measured voltage after release; with it, predict the force while the pad is held, and
    the hysteresis loops.

    Missing load paths are computed. Records begin at a travel of ``late`` mm.
    """

    def computed(terms: Prony) -> np.ndarray:
        return tail_of(hold_and_release(store, press, terms, late))

    terms, paths = fit(computed)
    study, finer = (hold_and_release(store, press, terms, late, size) for size in (None, FINER))
    slow, slow_finer = (cycle(store, press, terms, late, mesh_size=size) for size in (None, FINER))
    rubbed = cycle(store, press, (), late, FRICTION)
    return PronyFit(
        terms=terms,
        paths=paths,
        tail=tail_of(study),
        hold=hold_of(study),
        held_change=held_change_of(study),
        loop=loop_of(slow),
        rubbed=loop_of(rubbed),
        stiffer=float(rubbed.force.max() / slow.force.max()),
        errors=errors_of(study, finer, slow, slow_finer),
    )


def errors_of(study: xr.Dataset, finer: xr.Dataset, slow: xr.Dataset, slow_finer: xr.Dataset) -> MemoryErrors:
    """Numerical errors of a hold with release, and of a loading cycle, from the differences to finer elements."""
    pressed = {"taxel": measured.PRESSED}
    light = (study.change_error / study.change[len(HOLD_TIMES)]).sel(pressed).values
    step_error = study.step_error.values
    release, hold_rows = slice(-len(measured.TAIL_TIMES), None), slice(1, 1 + len(HOLD_TIMES))
    tail = np.sqrt((tail_of(finer) - tail_of(study)) ** 2 + light[release] ** 2 + step_error[release] ** 2)
    hold = np.hypot(hold_of(finer) - hold_of(study), step_error[hold_rows].max())
    change_error = float(np.hypot(held_change_of(finer) - held_change_of(study), light[hold_rows].max()))
    noise = 100 * float((slow.change_error / slow.change.max("row")).sel(pressed).max())
    step_noise = 200 * float(slow.step_error.max())
    noises = step_noise, step_noise, noise, noise
    widths = zip(loop_of(slow), loop_of(slow_finer), noises, strict=True)
    return MemoryErrors(
        tail,
        hold,
        change_error,
        HysteresisLoop(*(float(np.hypot(finer_value - value, noise)) for value, finer_value, noise in widths)),
    )


def held_change_of(study: xr.Dataset) -> float:
    """Largest relative difference, from 0.5 s on, between the change of the pressed taxel's reading during the hold and
    its change at the end: the largest abs(c(t) / c(end) - 1), where c(t) is the change relative to rest.
    """
    change = study.change.sel(taxel=measured.PRESSED).values[1 : 1 + len(HOLD_TIMES)]
    late = change[np.array(HOLD_TIMES) >= 0.5]
    return float(np.abs(late / change[-1] - 1).max())


def slow_term() -> tuple[float, float]:
    """Find an additional relaxation term that would explain the measured loop of the force.

    The solid is assumed linear, and its load a triangle in time. The relaxation time in `SLOW` is chosen that leaves
    the smallest change at the last measured time after release. The function returns this time in s, and the fraction
    of the change that remains."""
    end, hold = measured.TAIL_TIMES[-1], measured.HOLD_WINDOWS[-1][-1]
    remaining = []
    for time in SLOW:
        width, relaxed = _loop_per_share(time)
        weight = measured.FORCE_LOOP / (100 * width + measured.FORCE_LOOP * relaxed)
        remaining.append(
            -weight * np.expm1(-hold / time) * np.exp(-(1 - weight) * end / time) if weight < 1 else np.inf
        )
    best = int(np.argmin(remaining))
    return float(SLOW[best]), float(remaining[best])


def linear_loop(terms: Prony) -> float:
    """Width of the hysteresis loop of the force of a linear solid with a Prony series, in percent of the largest
    force."""
    shares = np.array([weight for weight, _ in terms])
    widths, relaxed = np.array([_loop_per_share(time) for _, time in terms]).T
    return float(100 * (shares @ widths) / (1 - shares @ relaxed))


def _loop_per_share(time: float) -> tuple[float, float]:
    """Hysteresis loop of a linear solid with one Prony term of relaxation time ``time``, in s.

    Returns the width of the loop per weight of the term, relative to the largest force without the term, and the
    fraction of the term that has relaxed when the load reverses."""
    half = measured.CYCLE_SECONDS / 2
    t = np.linspace(0.0, half, 401)
    loading = -time / half * np.expm1(-t / time)
    unloading = loading[-1] * np.exp(-t / time) + time / half * np.expm1(-t / time)
    relaxed, relaxed_unloading = t / half - loading, 1 - t / half - unloading
    return float((relaxed_unloading[::-1] - relaxed).max()), float(relaxed[-1])


def measured_tail() -> np.ndarray:
    """Measured changes of the voltage at the times `measured.TAIL_TIMES` after release, (8,), relative to the change
    during the hold."""
    return np.array(measured.TAIL_VOLTS) / (measured.HELD_SHARE * measured.PRESSES[measured.PRESSED].at_rest)


def fit(computed: Callable[[Prony], np.ndarray]) -> tuple[Prony, int]:
    """Fit the Prony series whose computed changes after release, ``computed(terms)``, are closest to the measured
    changes. Returns the series and the number of series that were computed.

    The method is space mapping (J. W. Bandler et al., 1994): each iteration minimises the squared relative errors of
    the linear model :func:`linear_tail`, scaled by the ratio of the computed changes to the linear model at the last
    weights, until the weights converge.
    """
    target, shares = measured_tail(), np.array([0.1, 0.01, 0.01])
    ratio = np.ones(len(target))

    def misfit(logs: np.ndarray) -> np.ndarray:
        return linear_tail(np.exp(logs)) * ratio / target - 1

    for count in range(MOST_PATHS + 1):
        previous, shares = shares, np.exp(least_squares(misfit, np.log(shares)).x)
        terms = tuple((float(f"{weight:.4g}"), time) for weight, time in zip(shares, TIMES, strict=True))
        if count == MOST_PATHS or (count and np.all(np.abs(shares - previous) <= SETTLED * shares)):
            break
        ratio = computed(terms) / linear_tail(np.array([weight for weight, _ in terms]))
    return terms, count


def linear_tail(shares: np.ndarray) -> np.ndarray:
    """Strain of a linear solid whose stress is released after a long hold, relative to the strain during the hold.

    Each Prony term is a spring in series with a dashpot. All terms act in parallel, with one more spring. The stiffness
    of a term's spring, relative to that of all springs together, is its weight g. Its relaxation time is tau.

    Let p be g times the strain of the term's dashpot. Without stress, the strain of the solid is the sum of all p. Each
    p follows dp/dt = (g strain - p) / tau. At the end of the long hold, each dashpot has the strain of the solid, so
    p = g.

    Parameters
    ----------
    shares : (k,) ndarray
        Weight g of each term. The relaxation times are those in `TIMES`.

    Returns
    -------
    (8,) ndarray
        Strains at the times `measured.TAIL_TIMES` after release.
    """
    rates = -(np.eye(len(shares)) - shares[:, None]) / np.array(TIMES)[:, None]
    return np.array([(expm(rates * time) @ shares).sum() for time in measured.TAIL_TIMES])


def tail_of(study: xr.Dataset) -> np.ndarray:
    """Computed changes of the reading at the times `measured.TAIL_TIMES` after release, (8,), relative to the change at
    the end of the hold."""
    change = study.change.sel(taxel=measured.PRESSED).values
    return change[-len(measured.TAIL_TIMES) :] / change[len(HOLD_TIMES)]


def hold_of(study: xr.Dataset) -> np.ndarray:
    """Mean force in each of the four time windows of the hold, (4,), relative to the last window. Forces are
    interpolated linearly in the logarithm of time."""
    force = study.force.values[1 : 1 + len(HOLD_TIMES)]
    means = []
    for window in measured.HOLD_WINDOWS:
        times = np.linspace(*window, 1000)
        means.append(np.interp(np.log(times), np.log(HOLD_TIMES), force).mean())
    return np.array(means) / means[-1]


def loop_of(study: xr.Dataset) -> HysteresisLoop:
    """Widths of the hysteresis loops and energy loss of a computed cycle, from rest to rest."""
    change = study.change.sel(taxel=measured.PRESSED).values
    half = len(change) // 2 + 1
    travel = np.insert(study.travel.values[:half], 0, 0.0)
    loading, unloading = (
        np.stack([np.insert(values[rows], 0, 0.0) for values in (study.force.values, change)])
        for rows in (slice(None, half), slice(None, -half - 1, -1))
    )
    force, volts = loading - unloading
    return HysteresisLoop(
        100 * np.abs(force).max() / loading[0].max(),
        100 * np.trapezoid(force, travel) / np.trapezoid(loading[0], travel),
        100 * np.abs(_at_equal_force(*loading, *unloading)).max() / loading[1].max(),
        100 * np.abs(volts).max() / loading[1].max(),
    )


def _at_equal_force(
    force: np.ndarray, change: np.ndarray, force_back: np.ndarray, change_back: np.ndarray
) -> np.ndarray:
    """Change of the reading during loading minus that during unloading, at the forces of unloading.

    The end at rest is left out. There the curves do not meet, because the indenter leaves the pad before the pad has
    recovered.
    """
    return CubicSpline(force, change)(force_back[1:]) - change_back[1:]
