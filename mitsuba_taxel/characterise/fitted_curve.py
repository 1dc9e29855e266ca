"""Smooth curves through noisy readings along a force, with the errors of their slopes due to noise and to the fit.

A curve is a sum of Legendre polynomials of the force. The coefficients of a smooth function fall geometrically with the
degree (L. N. Trefethen, Approximation Theory and Approximation Practice, 2019, chapter 8). So the coefficient of degree
k >= 2 is taken as normal with the variance s^2 q^(2 (k - 2)); those of degree 0 and 1 are free. Size s and ratio q are
averaged with the weights that the readings give them (C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for
Machine Learning, 2006, chapters 2 and 5). Degrees beyond the number of readings are included, so that what the readings
do not resolve is part of the error.

The slope is a weighted sum of the readings. Its error due to noise follows from the scatter of the same sum over
replicates that share their random numbers, for any correlation of the readings. Its error due to the fit is the
remaining part of the standard deviation of the slope, given the readings.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from mitsuba_taxel.base.replicates import standard_error

FEWEST = 4
"""Least number of forces of a fitted curve: with three, a parabola is not distinguished from noise."""
BEYOND = 6
"""Number of polynomials beyond those that the readings determine."""
SIZES = 10.0 ** np.arange(-4.0, 0.01, 0.5)
"""Sizes s, relative to the range of the readings."""
RATIOS = np.array([0.05, 0.1, 0.2, 0.35, 0.5, 0.7])
"""Ratios q, each with a prior probability proportional to (1 - q)^2."""
LEAST_CHANCE = 1e-3
"""Probability of a size and ratio, relative to the likeliest, below which they are left out."""
FREE = 30.0
"""Standard deviation of the coefficients of degree 0 and 1, relative to the range of the readings."""


class FittedSlopes(NamedTuple):
    """Values and slopes of a fitted curve at P forces, for R replicates and C channels.

    Attributes
    ----------
    samples : (P, R, C) ndarray
        Slopes of each replicate.
    fit_error : (P, C) ndarray
        Standard deviations of the slopes due to the fit: the readings do not determine the curve between the forces.
    interpolation_noise : (P, C) ndarray
        Standard errors, due to noise, of the slopes of the polynomial that passes through all readings. Where
        ``fit_error`` is larger, more forces are needed rather than more replicates.
    values : (P, R, C) ndarray
        Values of the curve for each replicate.
    value_fit_error : (P, C) ndarray
        Standard deviations of the values due to the fit.
    """

    samples: np.ndarray
    fit_error: np.ndarray
    interpolation_noise: np.ndarray
    values: np.ndarray
    value_fit_error: np.ndarray

    @property
    def slope(self) -> np.ndarray:
        """Slopes (P, C), the mean over the replicates."""
        return self.samples.mean(axis=1)

    @property
    def noise(self) -> np.ndarray:
        """Standard errors (P, C) of the slopes by noise."""
        return standard_error(self.samples, axis=1)

    @property
    def error(self) -> np.ndarray:
        """Standard errors (P, C) of the slopes, by noise and by the fit."""
        return np.hypot(self.noise, self.fit_error)


def fitted_slopes(force: np.ndarray, samples: np.ndarray, positions: np.ndarray) -> FittedSlopes:
    """Fit a smooth curve to noisy readings along a force, and return its slopes and values with their errors.

    Parameters
    ----------
    force : (N,) ndarray
        Distinct forces in N, at least `FEWEST`, in any order.
    samples : (N, R, C) ndarray
        Readings of R replicates, two or more, and C channels. Noise may be correlated between forces.
    positions : (P,) ndarray
        P forces in N at which slopes and values are returned.

    Returns
    -------
    FittedSlopes
        Slopes in the unit of the readings per N, values in the unit of the readings.
    """
    # Legendre polynomials of the force, scaled to -1 ... 1, and their derivatives by the force.
    middle, half = (force.max() + force.min()) / 2, np.ptp(force) / 2
    degree = len(force) - 1 + BEYOND
    x, at = (force - middle) / half, (positions - middle) / half
    basis, basis_at = legendre.legvander(x, degree), legendre.legvander(at, degree)
    slope_at = np.stack([legendre.legval(at, legendre.legder(row)) for row in np.eye(degree + 1)], axis=1) / half

    # The polynomial through all readings.
    through = np.linalg.solve(basis[:, : len(force)].T, slope_at[:, : len(force)].T).T
    interpolation_noise = standard_error(np.einsum("pn,nrc->prc", through, samples), axis=1)

    # Each channel has its own weights.
    shape = (len(positions), *samples.shape[1:])
    slopes, values = np.empty(shape), np.empty(shape)
    errors = np.zeros((2, len(positions), samples.shape[2]))
    for channel in range(samples.shape[2]):
        readings = samples[:, :, channel]
        variances, chances = _priors(basis, readings)
        rows = np.concatenate([slope_at, basis_at])
        noise, mean = _noise(basis, readings), readings.mean(axis=1)
        every = np.array([np.linalg.solve(basis * v @ basis.T + noise, basis * v @ rows.T).T for v in variances])
        weights = np.tensordot(chances, every, axes=1)
        # Variance within each size and ratio, and variance of their means. The part due to noise is subtracted here, as
        # it follows from the replicates.
        within = np.einsum("rk,hk,rk->hr", rows, variances, rows) - np.einsum(
            "hrn,nk,hk,rk->hr", every, basis, variances, rows, optimize=True
        )
        variance = chances @ (within + (every @ mean - weights @ mean) ** 2)
        fit = np.sqrt(np.maximum(variance - np.einsum("rn,nm,rm->r", weights, noise, weights), 0.0))
        slopes[..., channel], values[..., channel] = np.split(weights @ readings, 2)
        errors[..., channel] = np.split(fit, 2)
    return FittedSlopes(slopes, errors[0], interpolation_noise, values, errors[1])


def _noise(basis: np.ndarray, readings: np.ndarray) -> np.ndarray:
    """Covariance (N, N) of the means of N noisy readings over R replicates, (N, R); the weights of the fitted curve
    follow from it.

    It is assumed to be diagonal in the amplitudes of orthogonal polynomials. The sample covariance of few replicates is
    not used: it has too little noise in some directions, to which the fit would then give too much weight.
    """
    modes, _ = np.linalg.qr(basis[:, : len(readings)])
    variance = standard_error(modes.T @ readings, axis=1) ** 2
    scale = np.ptp(readings.mean(axis=1)) or 1.0
    return modes * np.maximum(variance, (1e-5 * scale) ** 2) @ modes.T


def _priors(basis: np.ndarray, readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Prior variances (H, K) of the K coefficients of a curve, for each of H pairs of size and ratio, and the
    probability (H,) of each pair.
    """
    mean, noise = readings.mean(axis=1), _noise(basis, readings)
    scale = np.ptp(mean) or 1.0
    degrees = np.arange(basis.shape[1])
    variances, logarithms = [], []
    for size in SIZES * scale:
        for ratio in RATIOS:
            variance = np.where(degrees < 2, (FREE * scale) ** 2, size**2 * ratio ** (2.0 * (degrees - 2)))
            factor = np.linalg.cholesky(basis * variance @ basis.T + noise)
            whitened = np.linalg.solve(factor, mean - mean.mean())
            variances.append(variance)
            logarithms.append(2 * np.log1p(-ratio) - 0.5 * whitened @ whitened - np.log(np.diag(factor)).sum())
    chances = np.exp(np.array(logarithms) - max(logarithms))
    likely = chances > LEAST_CHANCE
    return np.array(variances)[likely], chances[likely] / chances[likely].sum()
