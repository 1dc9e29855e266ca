"""Noise of test curves, from a smooth curve through each test that does not depend on a law."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.fitting.material.candidates import flexible_columns
from mitsuba_taxel.fitting.material.curves import StressCurve

FLOOR = 0.03
"""Least deviation of noise that grows with the stress, relative to the deviation at the largest stress."""
MOST_COLUMNS = 4
CONTRADICTION = 0.10
"""Difference of two tests of one mode, relative to the stress, that is refused if noise does not explain it."""


class CurveNoise(NamedTuple):
    """Noise of the stress in a test curve of N rows.

    Attributes
    ----------
    deviation : (N,) ndarray
        Standard deviation of each row in MPa.
    relative : float
        Deviation at the largest stress, relative to that stress.
    grows : bool
        Whether the deviation grows with the stress.
    slack : float
        Nominal strain at which the stress begins: slack of the specimen if positive, preload if negative, 0 if the
        curve starts at the origin.
    """

    deviation: np.ndarray
    relative: float
    grows: bool
    slack: float = 0.0


def taken_up(curve: StressCurve, slack: float) -> np.ndarray:
    """Stretches (N,) of a curve relative to the length at which the specimen becomes taut; 1 for rows before."""
    sign = 1.0 if curve.strain.sum() > 0 else -1.0
    return 1 + sign * np.maximum(sign * curve.strain - slack, 0)


def curve_noise(curve: StressCurve, slack: float = 0.0) -> CurveNoise:
    """Estimate the noise of a test curve from its deviation from a smooth curve.

    Parameters
    ----------
    curve : StressCurve
        Loading branch of a test.
    slack : float
        Nominal strain at which the stress begins.

    Returns
    -------
    CurveNoise
        Noise, either constant or growing with the stress, whichever is more likely.
    """
    fitted, deviation, grows = _smooth(curve, slack)
    return CurveNoise(deviation, float(deviation.max() / max(np.abs(fitted).max(), 1e-300)), grows, slack)


def smooth_curve(curve: StressCurve, slack: float = 0.0) -> np.ndarray:
    """Stress (N,) in MPa of a smooth curve through the rows of a test, which does not depend on a law.

    Parameters
    ----------
    curve : StressCurve
        Loading branch of a test.
    slack : float
        Nominal strain at which the stress begins.

    Returns
    -------
    (N,) ndarray
        Smooth stress.
    """
    return _smooth(curve, slack)[0]


def _smooth(curve: StressCurve, slack: float = 0.0) -> tuple[np.ndarray, np.ndarray, bool]:
    """Smooth curve through the rows of a test, deviation of each row, and whether the deviation grows with the stress.
    """
    columns = flexible_columns(curve.mode, taken_up(curve, slack))
    columns = columns[:, : min(MOST_COLUMNS, len(curve.lines) - 2)]
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    fitted = columns @ np.linalg.lstsq(columns, curve.stress, rcond=None)[0]
    freedom = len(fitted) - columns.shape[1]
    results = []
    for grows in (False, True):
        for _ in range(3 if grows else 1):
            relative = np.abs(fitted) + FLOOR * np.abs(fitted).max() if grows else np.ones(len(fitted))
            weighted = columns / relative[:, None]
            fitted = columns @ np.linalg.lstsq(weighted, curve.stress / relative, rcond=None)[0]
        residual = (curve.stress - fitted) / relative
        variance = max(float(residual @ residual) / freedom, 1e-300)
        likelihood = -0.5 * len(fitted) * np.log(variance) - np.log(relative).sum()
        results.append((likelihood, fitted, np.sqrt(variance) * relative, grows))
    return max(results, key=lambda entry: entry[0])[1:]


def refuse_contradictions(curves: list[StressCurve], noises: list[CurveNoise]) -> list[str]:
    """Compare tests of the same mode where their strains overlap, and refuse tests that contradict each other.

    Parameters
    ----------
    curves : list[StressCurve]
        All tests.
    noises : list[CurveNoise]
        Their noise.

    Returns
    -------
    list[str]
        Warnings of tests that differ by more than their noise, but by less than :data:`CONTRADICTION`.

    Raises
    ------
    InputError
        if two tests differ by more; the message names the row with the largest difference.
    """
    warnings = []
    for j, (second, noise) in enumerate(zip(curves, noises, strict=True)):
        for first, first_noise in zip(curves[:j], noises[:j], strict=True):
            if first.mode != second.mode or np.sign(first.strain.sum()) != np.sign(second.strain.sum()):
                continue
            reach = min(np.abs(first.strain).max(), np.abs(second.strain).max())
            inside = (np.abs(second.strain) <= reach) & (np.abs(second.strain) > 0.1 * reach)
            if not inside.any():
                continue
            smooth = [smooth_curve(curve) for curve in (first, second)]
            order = np.argsort(np.abs(first.strain))
            at, known = np.abs(second.strain), np.abs(first.strain)[order]
            other = np.interp(at, known, smooth[0][order])
            other_deviation = np.interp(at, known, first_noise.deviation[order])
            difference = np.where(inside, smooth[1] - other, 0.0)
            error = np.hypot(
                noise.deviation * np.sqrt(MOST_COLUMNS / len(second.lines)),
                other_deviation * np.sqrt(MOST_COLUMNS / len(first.lines)),
            )
            relative = np.abs(difference) / np.maximum(np.abs(other), 1e-300)
            significant = np.where(np.abs(difference) > 4 * error, relative, 0.0)
            if not significant.any():
                continue
            row = int(np.argmax(significant))
            words = (
                f"test {second.file!r}, line {second.lines[row]}: {second.stress[row]:.4g} MPa at a strain of "
                f"{second.strain[row]:.4g}, {difference[row] / other[row]:+.0%} from {first.file!r}"
            )
            if significant[row] > CONTRADICTION:
                raise InputError(
                    f"{words}, which their noise does not explain: tests of one silicone that agree are needed, or one "
                    "fit for each."
                )
            warnings.append(f"{words}: more than their noise; intervals do not include the scatter of specimens")
    return warnings
