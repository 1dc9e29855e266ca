"""Slopes of readings along one run of load."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.characterise.experiment import Branch, Tangents
from mitsuba_taxel.characterise.replicates import at_largest

PLACES = 1001
"""Evenly spaced points of a run at which the largest slope of curves is searched."""


class Slopes(NamedTuple):
    """Slopes (channels,) in W/N or V/N with their standard errors; NaN where the run has none.

    If the run has tangents these are slopes of the cubic curves through values and slopes, with the errors of the
    slopes. Otherwise they are differences of readings:

    ``max_slope`` : between the neighbouring points where it is largest in magnitude, which the literature on this kind
    of sensor calls the sensitivity of a simulated taxel (paper, section 2.3). ``max_slope_at`` : the middle between
    these points in N.

    ``mean_slope`` : between the ends of the run; the paper's sensitivity of a measured taxel (section 3.1) is that of
    the force-voltage relation.

    ``zero_slope`` : at zero force, of the parabola through the three points of least force in magnitude, evenly spaced
    or not. It is exact for a parabola; its error is of second order in their distances (v'''/6 times the product of the
    distances of the two other points from zero, if one lies there). With two points it is the slope between them. Zero
    must lie in the run, or closer to it than the distance of its neighbouring points.
    """

    max_slope: np.ndarray
    max_slope_error: np.ndarray
    max_slope_at: np.ndarray
    mean_slope: np.ndarray
    mean_slope_error: np.ndarray
    zero_slope: np.ndarray
    zero_slope_error: np.ndarray


def slopes(run: Branch) -> Slopes:
    """All slopes of a run, so that common noise of its readings cancels.

    Parameters
    ----------
    run : Branch
        With tangents, whose slopes are then taken, or without.

    Returns
    -------
    Slopes
        In the unit of the readings per N; NaN for a run of one point.
    """
    channels = run.samples.shape[2]
    if len(run.force) < 2:
        return Slopes(*np.full((len(Slopes._fields), channels), np.nan))
    if run.tangents is not None:
        return _of_tangents(run.force, run.tangents)
    steps = np.diff(run.samples, axis=0) / np.diff(run.force)[:, None, None]
    steepest = at_largest(steps)
    mean = (run.samples[-1] - run.samples[0]) / (run.force[-1] - run.force[0])
    zero = np.einsum("p,prc->rc", *_at_zero(run))
    middle = (run.force[1:] + run.force[:-1]) / 2
    # The largest is anywhere within the excess.
    steepest_error = np.hypot(steepest.error_of(steepest.magnitude), steepest.excess / np.sqrt(12))
    return Slopes(
        steepest.value,
        steepest_error,
        middle[steepest.place],
        mean.mean(axis=0),
        standard_error(mean),
        zero.mean(axis=0),
        standard_error(zero),
    )


def relative_slope(run: Branch, found: Slopes, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean slopes of a run over readings at rest, and their standard errors.

    A ratio of means, with its error to first order; common noise of readings and rest cancels.

    Parameters
    ----------
    run : Branch
        Of growing force.
    found : Slopes
        Of the run.
    rest : (replicates, channels) ndarray
        Readings at rest.

    Returns
    -------
    slope, error : (channels,) ndarray
        In %/N.
    """
    level = rest.mean(axis=0)
    level = np.where(level != 0, level, np.nan)
    ratio = found.mean_slope / level
    if run.tangents is not None or len(run.force) < 2:
        return 100 * ratio, 100 * np.hypot(found.mean_slope_error, ratio * standard_error(rest)) / np.abs(level)
    slope = (run.samples[-1] - run.samples[0]) / (run.force[-1] - run.force[0])
    return 100 * ratio, 100 * standard_error(slope - ratio * rest) / np.abs(level)


def _of_tangents(force: np.ndarray, tangents: Tangents) -> Slopes:
    from scipy.interpolate import CubicHermiteSpline

    order = np.argsort(force)
    x, (value, slope, error) = force[order], tangents.part(order)
    curve, channels = CubicHermiteSpline(x, value, slope).derivative(), np.arange(slope.shape[1])
    places = np.union1d(np.linspace(x[0], x[-1], PLACES), x)
    rates = curve(places)
    most = np.abs(rates).argmax(axis=0)
    errors = _between(places, x, error)
    length = x[-1] - x[0]
    zero = np.array([0.0 if max(x[0], -x[-1], 0.0) <= np.diff(x).min() else np.nan])
    return Slopes(
        rates[most, channels],
        errors[most, channels],
        places[most],
        (value[-1] - value[0]) / length,
        np.trapezoid(error, x, axis=0) / length,
        curve(zero)[0],
        _between(zero, x, error)[0],
    )


def _between(places: np.ndarray, x: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(places, channels) linear interpolation of values (x, channels), constant beyond them."""
    return np.stack([np.interp(places, x, column) for column in values.T], axis=1)


def _at_zero(run: Branch) -> tuple[np.ndarray, np.ndarray]:
    """Weights (points,) of the derivative at zero force, and the samples of these points."""
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
