"""Dies and resin of a photo-reflector by least squares, from a curve of current over distance.

The model is the power under a mirror or a white card, times an unknown constant (Golub and Pereyra, SIAM J. Numer.
Anal. 10, 413, 1973: for each set of the other unknowns, the best constant has a closed form). Intervals are those of
the profile of the sum of squares: all values of an unknown for which the smallest sum of squares over all others does
not exceed (1 + t^2 / f) times the least one, with Student's t for f degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.fitting.part.distances import DistanceCurve, read_distances
from mitsuba_taxel.parts import Datasheet, Part, distance_model, read_datasheet
from mitsuba_taxel.parts.part import UNKNOWN
from mitsuba_taxel.parts.refraction import sobol_points

CONFIDENCE = 0.95
SMALLEST_DIE = 0.02
"""Smallest size of a die, mm."""
INDICES = (1.3, 1.7)
"""Range of refractive indices of clear silicones and epoxies."""
FLOOR = {"mirror": 5e-4, "white card": 5e-3}
"""Least noise, relative to the largest current, by reflector: the error of the computed curve."""
POINTS = {"mirror": 2**10, "white card": 2**12}
"""Rays per height, by reflector."""
WIDE = 0.5
"""Length of an interval, relative to the range, from which a curve does not determine an unknown."""
_STARTED = 3
"""Starting points: the best of quasi-random points of the ranges."""
_STEP = 0.01
_RESTARTS = 6


@dataclass(frozen=True)
class PartUnknown:
    """An unknown of a part.

    Attributes
    ----------
    name, unit : str
        Name and unit.
    entries : tuple[str, ...]
        Entries of the file of a part that have its value, such as ``emitter.die_width`` and ``emitter.die_length``.
    low, high : float
        Smallest and largest allowed value.
    value : float
        Value that fits best.
    interval : tuple[float, float]
        Confidence interval; an end equal to `low` or `high` is a limit of the allowed values, not of the data.
    """

    name: str
    unit: str
    entries: tuple[str, ...]
    low: float
    high: float
    value: float = float("nan")
    interval: tuple[float, float] = (float("nan"), float("nan"))

    @property
    def determined(self) -> bool:
        """Whether the curve determines the unknown: whether its interval is narrower than `WIDE` times the range of
        allowed values."""
        return self.interval[1] - self.interval[0] < WIDE * (self.high - self.low)


@dataclass(frozen=True, eq=False)
class PartFit:
    """Result of `fit_part`.

    Attributes
    ----------
    part : Part
        The part with the fitted numbers and the measured curve.
    curve : DistanceCurve
        The measured curve.
    unknowns : list[PartUnknown]
        Fitted unknowns with their intervals.
    model : (N,) ndarray
        Computed currents of the rows, relative to the largest measured current.
    rms : float
        Root mean square of the differences, relative to the largest measured current.
    notes : list[str]
        Notes on numbers that the curve does not determine.
    """

    part: Part
    curve: DistanceCurve
    unknowns: list[PartUnknown]
    model: np.ndarray
    rms: float
    notes: list[str] = field(default_factory=list)


def fit_part(curve: str | Path, part: str | Path, zero: float = 0.0) -> PartFit:
    """Fit dies, their depth, and the index of the resin to a curve of current over distance.

    Unknowns are the numbers that the file of the part states as unknown; if it states none, the sizes and the depth
    of both dies, and the index. Dies are squares, and lie at the same depth if both depths are unknown.

    Parameters
    ----------
    curve : str or Path
        Table of distances and currents; see `read_distances`.
    part : str or Path
        Name in the catalogue, or file of a part, with positions and windows. Its ``distance_reflector`` is the
        reflector of the curve.
    zero : float
        Height above the windows of the plane from which distances are counted, mm.

    Returns
    -------
    PartFit
        The part with the fitted numbers, and their intervals.

    Raises
    ------
    InputError
        if the curve or the part cannot be used; the message says what is needed.
    """
    measured, sheet = read_distances(curve, zero), read_datasheet(part)
    unknowns = part_unknowns(sheet)
    free = len(measured.heights) - len(unknowns) - 1
    if free < 1:
        raise InputError(
            f"curve {measured.file} has {len(measured.heights)} rows: at least {len(unknowns) + 2} are needed for "
            f"{len(unknowns)} unknowns and the constant of the current."
        )
    values, ends, model = _least_squares(sheet, measured, unknowns, free)
    fitted = [
        PartUnknown(u.name, u.unit, u.entries, u.low, u.high, float(value), (float(low), float(high)))
        for u, value, (low, high) in zip(unknowns, values, ends, strict=True)
    ]
    rms = float(np.sqrt(np.mean((model - measured.currents) ** 2)))
    notes = [
        f"The curve does not determine {u.name}: {u.interval[0]:.3g} to {u.interval[1]:.3g} {u.unit}".rstrip()
        + f" of {u.low:.3g} to {u.high:.3g} fit as well."
        for u in fitted
        if not u.determined
    ]
    rows = tuple(zip(measured.heights.tolist(), measured.currents.tolist(), strict=True))
    part_with_curve = replace(_with(sheet, unknowns, values), distance_curve=rows)
    return PartFit(part_with_curve, measured, fitted, model, rms, notes)


def part_unknowns(sheet: Datasheet) -> list[PartUnknown]:
    """Find the unknowns of a part that a curve of current over distance can determine, with their ranges.

    Parameters
    ----------
    sheet : Datasheet
        Contents of the file of the part.

    Returns
    -------
    list[PartUnknown]
        Unknowns without values.

    Raises
    ------
    InputError
        if other numbers are unknown, such as positions.
    """
    missing = set(sheet.missing)
    unknowns = []
    for role in ("emitter", "detector"):
        entries = tuple(f"{role}.die_{extent}" for extent in ("width", "length"))
        if missing & {*entries} or not missing:
            unknowns.append(PartUnknown(f"{role}'s die", "mm", entries, SMALLEST_DIE, _largest_die(sheet, role)))
        missing -= {*entries}
    depths = tuple(name for name in ("emitter.die_depth", "detector.die_depth") if name in missing or not sheet.missing)
    if depths:
        unknowns.append(PartUnknown("depth", "mm", depths, 0.0, 0.9 * sheet.body[2]))
    if "resin_index" in missing or not sheet.missing:
        unknowns.append(PartUnknown("resin_index", "", ("resin_index",), *INDICES))
    missing -= {*depths, "resin_index"}
    if missing:
        raise InputError(
            f"part {sheet.name}: {', '.join(sorted(missing))} cannot be fitted to a curve of current over distance: "
            "state numbers; only sizes and depths of dies, and resin_index, may be unknown."
        )
    return unknowns


def _largest_die(sheet: Datasheet, role: str) -> float:
    """Largest size of a square die within the body and as wide as the window, mm."""
    side = sheet.stated[role]
    room = [side[name] for name in ("window_width", "window_length") if side[name] != UNKNOWN]
    room += [
        length - 2 * abs(side.get(axis, 0.0))
        for axis, length in zip("xy", sheet.body, strict=False)
        if side.get(axis, 0.0) != UNKNOWN
    ]
    return float(min(room))


def _with(sheet: Datasheet, unknowns: list[PartUnknown], values: np.ndarray) -> Part:
    """Copy of a part in which the unknowns have given values."""
    pairs = zip(unknowns, values, strict=True)
    return sheet.with_numbers({entry: float(value) for unknown, value in pairs for entry in unknown.entries})


def _least_squares(
    sheet: Datasheet, measured: DistanceCurve, unknowns: list[PartUnknown], free: int
) -> tuple[np.ndarray, list[tuple[float, float]], np.ndarray]:
    """Fit the free unknowns of a part to a measured curve: their values, the ends of their intervals, and the computed
    currents of the rows."""
    low = np.array([unknown.low for unknown in unknowns])
    span = np.array([unknown.high for unknown in unknowns]) - low
    heights, which = np.unique(measured.heights, return_inverse=True)

    def model(share: np.ndarray) -> np.ndarray:
        part = _with(sheet, unknowns, low + np.clip(share, 0, 1) * span)
        power = distance_model(part, heights, POINTS[sheet.distance_reflector])[which]
        return power * (power @ measured.currents / max(power @ power, 1e-300))

    def residual(share: np.ndarray) -> np.ndarray:
        return model(share) - measured.currents

    # The best of several starts, then the profile of each unknown; a better minimum on a profile starts anew.
    every = np.ones(len(unknowns), dtype=bool)
    best = min((_minimum(residual, start, every) for start in _starts(residual, len(unknowns))), key=lambda m: m[1])
    for _ in range(_RESTARTS):
        ends, better = _profiles(residual, best, free, FLOOR[sheet.distance_reflector])
        if better[1] >= best[1]:
            break
        best = min(_minimum(residual, better[0], every), better, key=lambda found: found[1])
    ranges = [(base + lower * s, base + upper * s) for (lower, upper), s, base in zip(ends, span, low, strict=True)]
    return low + best[0] * span, ranges, model(best[0])


def _starts(residual: Callable[[np.ndarray], np.ndarray], number: int) -> list[np.ndarray]:
    """Starting points of the fit, from 0 to 1 along each unknown: those with a small sum of squares, because there are
    often several minima."""
    trials = sobol_points(number, 2 ** (3 + number)) + 0.5
    squares = np.array([np.sum(residual(trial) ** 2) for trial in trials])
    return [trials[index] for index in squares.argsort()[:_STARTED]]


def _minimum(
    residual: Callable[[np.ndarray], np.ndarray], start: np.ndarray, is_free: np.ndarray
) -> tuple[np.ndarray, float]:
    """Minimise the sum of squares over the free unknowns, each scaled from 0 to 1. Returns the position of the minimum
    and its value."""
    from scipy.optimize import least_squares

    if not is_free.any():
        return start, float(np.sum(residual(start) ** 2))

    def at(free: np.ndarray) -> np.ndarray:
        whole = start.copy()
        whole[is_free] = free
        return whole

    def slopes(free: np.ndarray) -> np.ndarray:
        here, columns = residual(at(free)), []
        for number in range(len(free)):
            step = _STEP if free[number] < 0.5 else -_STEP
            moved = free.copy()
            moved[number] += step
            columns.append((residual(at(moved)) - here) / step)
        return np.stack(columns, axis=1)

    def residual_at(free: np.ndarray) -> np.ndarray:
        return residual(at(free))

    inside = np.clip(start[is_free], 1e-6, 1 - 1e-6)
    found = least_squares(residual_at, inside, jac=slopes, bounds=(0, 1), xtol=1e-4, ftol=1e-4, max_nfev=15)
    return at(found.x), 2 * float(found.cost)


def _profiles(
    residual: Callable[[np.ndarray], np.ndarray], best: tuple[np.ndarray, float], free: int, floor: float
) -> tuple[list[tuple[float, float]], tuple[np.ndarray, float]]:
    """Ends of the confidence intervals of the unknowns, scaled from 0 to 1. Also returns the best point: ``best``, or a
    point on a profile whose sum of squares is clearly smaller.
    """
    from scipy.stats import t as student

    values, least = best
    variance = max(least / free, floor**2)
    allowed = least + student.ppf(0.5 + CONFIDENCE / 2, free) ** 2 * variance
    lowest, ends = best, []
    for number in range(len(values)):
        others = np.arange(len(values)) != number
        pair = []
        for limit in (0.0, 1.0):
            # The limit first; then bisection, each time from the last point within the interval.
            inner, outer, point, trial = values[number], limit, values.copy(), limit
            for _ in range(10):
                start = point.copy()
                start[number] = trial
                found = _minimum(residual, start, others)
                if found[1] < min(lowest[1], least - 0.05 * variance):
                    lowest = found
                if found[1] <= allowed:
                    inner, point = trial, found[0]
                else:
                    outer = trial
                if inner == limit or abs(outer - inner) < 0.05 * abs(outer - values[number]) + 1e-3:
                    break
                trial = 0.5 * (inner + outer)
            pair.append(inner if inner == limit else 0.5 * (inner + outer))
        ends.append((pair[0], pair[1]))
    return ends, lowest
