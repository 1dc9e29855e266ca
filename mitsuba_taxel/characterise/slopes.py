"""Slopes of readings along one run of load."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.characterise.experiment import Branch, Tangents
from mitsuba_taxel.characterise.fitted_curve import FEWEST, fitted_slopes
from mitsuba_taxel.characterise.replicates import at_largest

PLACES, FIT_PLACES = 1001, 101
"""Evenly spaced forces of a run at which the largest slope of a cubic curve, and of a fitted curve, is searched."""


class Slopes(NamedTuple):
    """Slopes (channels,) of readings along a run of load in W/N or V/N, with their standard errors; NaN where a slope
    is undefined.

    If the run has tangents, these are slopes of the cubic curves through values and slopes, with the errors of the
    slopes. If the run is fitted and has at least `FEWEST` points, the largest slope and that at zero force are those of
    the smooth curve through the readings, with the errors due to noise and to the fit. Otherwise slopes are differences
    of readings:

    ``max_slope`` : the slope of largest magnitude between neighbouring points, which the literature on this kind of
    sensor calls the sensitivity of a simulated taxel (paper, section 2.3). ``max_slope_at`` : the middle between these
    points in N. At an end of a bent run, the curve is steeper by half of the change from one such slope to the next.

    ``mean_slope`` : the slope between the ends of the run. The paper's sensitivity of a measured taxel (section 3.1) is
    the mean slope of the force-voltage relation.

    ``zero_slope`` : the slope at zero force of the parabola through the three points of least force in magnitude,
    evenly spaced or not. It is exact for a parabola; its error is of second order in the distances of the points
    (v'''/6 times the product of the distances of two points from zero, if the third lies at zero). With two points it
    is the slope between them. Zero must lie in the run, or closer to the run than the distance of its neighbouring
    points.
    """

    max_slope: np.ndarray
    max_slope_error: np.ndarray
    max_slope_at: np.ndarray
    mean_slope: np.ndarray
    mean_slope_error: np.ndarray
    zero_slope: np.ndarray
    zero_slope_error: np.ndarray


def slopes(run: Branch) -> Slopes:
    """Largest slope, mean slope and slope at zero force of the readings along a run, with their standard errors.

    Slopes are computed for each replicate, so that noise which all readings of a replicate share cancels.

    Parameters
    ----------
    run : Branch
        Readings along a force. If the run has derivatives (``tangents``), its slopes follow from them.

    Returns
    -------
    Slopes
        Slopes in the unit of the readings per N; NaN for a run of one point.
    """
    channels = run.samples.shape[2]
    if len(run.force) < 2:
        return Slopes(*np.full((len(Slopes._fields), channels), np.nan))
    if run.tangents is not None:
        return _of_tangents(run.force, run.tangents)
    if run.is_fitted and len(run.force) >= FEWEST:
        return _of_fit(run.force, run.samples)
    steps = np.diff(run.samples, axis=0) / np.diff(run.force)[:, None, None]
    steepest = at_largest(steps)
    mean = (run.samples[-1] - run.samples[0]) / (run.force[-1] - run.force[0])
    zero = np.einsum("p,prc->rc", *_at_zero(run))
    middle = (run.force[1:] + run.force[:-1]) / 2
    # The largest slope is uniformly distributed over the excess.
    steepest_error = np.hypot(steepest.error_of(steepest.magnitude), steepest.excess / np.sqrt(12))
    return Slopes(
        steepest.value,
        steepest_error,
        middle[steepest.point],
        mean.mean(axis=0),
        standard_error(mean),
        zero.mean(axis=0),
        standard_error(zero),
    )


def relative_slope(run: Branch, run_slopes: Slopes, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean slopes of a run relative to the readings at rest, with their standard errors.

    The result is a ratio of means, with its error to first order; common noise of readings and rest cancels.

    Parameters
    ----------
    run : Branch
        A run of growing force.
    run_slopes : Slopes
        Slopes of the run.
    rest : (replicates, channels) ndarray
        Readings at rest.

    Returns
    -------
    slope, error : (channels,) ndarray
        Relative slope and its standard error, in %/N.
    """
    level = rest.mean(axis=0)
    level = np.where(level != 0, level, np.nan)
    ratio = run_slopes.mean_slope / level
    if run.tangents is not None or len(run.force) < 2:
        return 100 * ratio, 100 * np.hypot(run_slopes.mean_slope_error, ratio * standard_error(rest)) / np.abs(level)
    slope = (run.samples[-1] - run.samples[0]) / (run.force[-1] - run.force[0])
    return 100 * ratio, 100 * standard_error(slope - ratio * rest) / np.abs(level)


def _of_tangents(force: np.ndarray, tangents: Tangents) -> Slopes:
    """Slopes of the cubic Hermite curves through values and slopes at the forces (points,) of a run."""
    from scipy.interpolate import CubicHermiteSpline

    order = np.argsort(force)
    x, (value, slope, error) = force[order], tangents.part(order)
    curve, channels = CubicHermiteSpline(x, value, slope).derivative(), np.arange(slope.shape[1])
    positions = np.union1d(np.linspace(x[0], x[-1], PLACES), x)
    rates = curve(positions)
    steepest = np.abs(rates).argmax(axis=0)
    errors = _between(positions, x, error)
    span = x[-1] - x[0]
    # The slope at zero is known only if zero lies in the run, or closer to it than its neighbouring points.
    zero = np.array([0.0 if max(x[0], -x[-1], 0.0) <= np.diff(x).min() else np.nan])
    return Slopes(
        rates[steepest, channels],
        errors[steepest, channels],
        positions[steepest],
        (value[-1] - value[0]) / span,
        np.trapezoid(error, x, axis=0) / span,
        curve(zero)[0],
        _between(zero, x, error)[0],
    )


def _of_fit(force: np.ndarray, samples: np.ndarray) -> Slopes:
    """Slopes of the smooth curve that is fitted to samples (points, replicates, channels) at forces (points,).

    The mean slope is the difference of the readings at the ends, which needs no curve.
    """
    low, high = force.min(), force.max()
    # Zero is the last position, if the curve reaches it or ends closer to it than its neighbouring points.
    outside = max(low, -high, 0.0)
    positions = np.append(np.linspace(low, high, FIT_PLACES), 0.0 if outside <= np.diff(np.sort(force)).min() else low)
    fit = fitted_slopes(force, samples, positions)
    slope, error, channels = fit.slope, fit.error, np.arange(samples.shape[2])
    steepest = np.abs(slope[:-1]).argmax(axis=0)
    mean = (samples[-1] - samples[0]) / (force[-1] - force[0])
    has_zero = positions[-1] == 0
    return Slopes(
        slope[steepest, channels],
        error[steepest, channels],
        positions[steepest],
        mean.mean(axis=0),
        standard_error(mean),
        np.where(has_zero, slope[-1], np.nan),
        np.where(has_zero, error[-1], np.nan),
    )


def _between(positions: np.ndarray, x: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear interpolation of values (x, channels) at positions, constant beyond the ends: (positions, channels)."""
    return np.stack([np.interp(positions, x, column) for column in values.T], axis=1)


def _at_zero(run: Branch) -> tuple[np.ndarray, np.ndarray]:
    """Samples near zero force, and the weights (points,) by which they are multiplied and summed to give the slope at
    zero force.
    """
    nearest = np.argsort(np.abs(run.force), kind="stable")[:3]
    x = run.force[nearest]
    outside = max(run.force.min(), -run.force.max(), 0.0)
    if outside > abs(x[1] - x[0]):
        weights = np.full(len(x), np.nan)
    elif len(x) == 2:
        weights = np.array([-1, 1]) / (x[1] - x[0])
    else:
        a, b = np.roll(x, -1), np.roll(x, -2)
        weights = -(a + b) / ((x - a) * (x - b))
    return weights, run.samples[nearest]
