"""Slopes of readings over force, free of most of the noise: of smooth curves through them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.characterise.replicates import Largest, at_largest, standard_error

HIGHEST_DEGREE = 8
SIGNIFICANT = 4.0
"""Standard errors, from 32 replicates, by which a coefficient must differ from zero: by chance 4 in 10 000 do so, and
some of the 72 of nine taxels in one study of 40."""


class Sensitivity(NamedTuple):
    """Slopes of the readings of one study along one force, in W/N, with standard errors.

    These are of the light and of the smoothing: what the first term that was left out would change is part of them.

    Attributes
    ----------
    max_slope : float
        Largest in magnitude of all taxels and force steps, its sign dropped; ``at`` is the middle of that step in N,
        ``taxel`` the number of the taxel.
    mean_slope : float
        From the first force to the last of the taxel for which that is largest in magnitude, with its sign.
    degree : int
        Of the polynomials whose slopes these are.
    raw_max_slope : float
        Without smoothing, noise included.
    """

    max_slope: float
    max_slope_error: float
    at: float
    taxel: int
    mean_slope: float
    mean_slope_error: float
    degree: int
    raw_max_slope: float


def sensitivity(study: xr.Dataset, force: str) -> Sensitivity:
    """What the paper calls sensitivity, the maximum slope of all curves, and the mean slope.

    Slopes over steps of 0.5 N hold far more noise than signal where the curve is flat. Hence each curve is replaced by
    the polynomial of the lowest degree that leaves nothing significant out (see :func:`smooth`), and the steps
    are taken of that. What is largest is chosen by one half of the replicates and read from the other.
    """
    ordered = study.sortby(force)
    x = ordered[force].values
    samples = ordered.replicate_power.transpose(force, "replicate", "taxel").values
    smoothed, finer, degree = smooth(x, samples)
    steepest = _steepest(x, smoothed)
    finer_steepest = _steepest(x, finer)
    change = finer_steepest.magnitude.mean() - steepest.magnitude.mean()
    step, taxel = divmod(int(steepest.place[0]), samples.shape[2])
    mean = at_largest(_mean_slope(x, smoothed).T[:, :, None])
    mean_change = (_mean_slope(x, finer) - _mean_slope(x, smoothed)).mean(axis=0)[mean.place[0]]
    return Sensitivity(
        float(steepest.magnitude.mean()),
        float(np.hypot(steepest.error_of(steepest.magnitude)[0], change)),
        float(x[step] + x[step + 1]) / 2,
        int(study.taxel.values[taxel]),
        float(mean.value[0]),
        float(np.hypot(mean.error_of(mean.magnitude)[0], mean_change)),
        degree,
        float(np.abs(_steps(x, samples).mean(axis=1)).max()),
    )


def smooth(force: np.ndarray, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Polynomials in force fitted to each replicate and taxel, and their degree, the same for all.

    The degree is the highest, of those up to :data:`HIGHEST_DEGREE`, whose coefficient in polynomials orthogonal
    over the forces differs from zero by more than :data:`SIGNIFICANT` standard errors in any taxel; at least 1.

    Parameters
    ----------
    force : (F,) ndarray
        N.
    samples : (F, replicates, taxels) ndarray
        W.

    Returns
    -------
    Samples (F, replicates, taxels) of the polynomials, and of those with one more term if there is one; the degree.
    """
    highest = min(HIGHEST_DEGREE, len(force) - 1)
    scaled = 2 * (force - force.min()) / np.ptp(force) - 1
    basis, _ = np.linalg.qr(np.polynomial.legendre.legvander(scaled, highest))
    coefficients = np.einsum("fd,frt->rdt", basis, samples)
    error = standard_error(coefficients)
    significant = np.abs(coefficients.mean(axis=0)) > SIGNIFICANT * error
    degree = int(max(1, *np.flatnonzero(significant.any(axis=1))))
    smoothed, finer = (
        np.einsum("fd,rdt->frt", basis[:, :terms], coefficients[:, :terms]) for terms in (degree + 1, degree + 2)
    )
    return smoothed, finer, degree


def _steepest(force: np.ndarray, samples: np.ndarray) -> Largest:
    """The slopes of the step and taxel where they are largest; its place counts taxels first."""
    steps = _steps(force, samples)
    return at_largest(steps.transpose(0, 2, 1).reshape(-1, steps.shape[1], 1))


def _steps(force: np.ndarray, samples: np.ndarray) -> np.ndarray:
    return np.diff(samples, axis=0) / np.diff(force)[:, None, None]


def _mean_slope(force: np.ndarray, samples: np.ndarray) -> np.ndarray:
    return (samples[-1] - samples[0]) / (force[-1] - force[0])
