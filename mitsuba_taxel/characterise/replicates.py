"""The largest of many noisy numbers, estimated from replicates that are common to all readings of an experiment."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.replicates import standard_error

HALVES = (slice(0, None, 2), slice(1, None, 2))
DRAWS = 64
"""Samples of the bootstrap: its standard deviation is then accurate to 9 %."""
FEWEST_SMOOTH = 4
"""Least number of points that are smoothed."""


class Largest(NamedTuple):
    """The number of largest magnitude among noisy numbers, from :func:`at_largest`: without the bias due to its choice.

    Attributes
    ----------
    magnitude : (replicates, channels) ndarray
        For each replicate, its sample where the smoothed mean of the other half of the replicates is largest, times the
        sign of that mean.
    sign : (channels,) ndarray
        Sign of the smoothed mean of all samples at ``point``.
    point : (channels,) ndarray of int
        Index where the smoothed mean of all samples is largest in magnitude.
    choice_error : (channels,) ndarray
        Standard error of the mean of ``magnitude`` due to the choice of the index.
    excess : (channels,) ndarray
        Largest mean of all samples minus the mean of ``magnitude``. The first is too large because of its noise, the
        second too small if noise chooses a wrong index: the true value lies between them.
    """

    magnitude: np.ndarray
    sign: np.ndarray
    point: np.ndarray
    choice_error: np.ndarray
    excess: np.ndarray

    @property
    def value(self) -> np.ndarray:
        """The largest number (channels,), with its sign."""
        return self.sign * self.magnitude.mean(axis=0)

    def error_of(self, samples: np.ndarray) -> np.ndarray:
        """Standard error (channels,) of the mean of samples (replicates, channels) computed from :attr:`magnitude`."""
        return np.hypot(standard_error(samples), self.choice_error)


def at_largest(samples: np.ndarray) -> Largest:
    """Estimate the number of largest magnitude among noisy numbers, such as slopes at the points of a curve.

    The largest of many noisy numbers is biased upwards. Each half of the replicates is therefore evaluated at the point
    where the other half is largest: that choice is independent of the noise of this half. If the two halves choose
    points of opposite signs, their magnitudes are averaged. Noise may choose a point whose number is not the largest,
    so the estimate is too low by up to ``excess``. To choose well, the choosing half is first smoothed along the
    points. With one replicate there is no other half, and the bias remains.

    Parameters
    ----------
    samples : (points, replicates, channels) ndarray
        The noisy numbers in any unit.

    Returns
    -------
    Largest
        Magnitude, sign, point and error for each channel.
    """
    _, replicates, channels = samples.shape
    mean = samples.mean(axis=1)
    smooth = _smooth(mean, _noise(samples))
    point = np.abs(smooth).argmax(axis=0)
    sign = np.sign(_at(smooth, point))
    if replicates < 2:
        return Largest(np.abs(_at(mean, point))[None], sign, point, *np.zeros((2, channels)))

    # Each half of the replicates, where the mean of the other half is largest.
    magnitude = np.empty((replicates, channels))
    for half, other_half in (HALVES, HALVES[::-1]):
        reference = _smooth(samples[:, other_half].mean(axis=1), _noise(samples[:, other_half]))
        chosen_point = np.abs(reference).argmax(axis=0)
        chosen = samples[chosen_point, :, np.arange(channels)].T * np.sign(_at(reference, chosen_point))
        magnitude[half] = chosen[half]

    excess = np.maximum(np.abs(mean).max(axis=0) - magnitude.mean(axis=0), 0.0)
    return Largest(magnitude, sign, point, _choice_error(samples, magnitude), excess)


def _choice_error(samples: np.ndarray, magnitude: np.ndarray) -> np.ndarray:
    """Standard error (channels,) of the mean of ``magnitude`` due to the choice of the point.

    The noise of each half chooses where the other half is evaluated, so both halves are too large, or too small,
    together. The bootstrap captures that (B. Efron, R. Tibshirani, An Introduction to the Bootstrap, 1993, chapter 6):
    the replicates of each half are resampled with replacement, and the estimate is repeated. The variance of the
    bootstrap is (n - 1) / n of that of the mean of n replicates.
    """
    halves = [samples[:, half] for half in HALVES]
    counts = [half.shape[1] for half in halves]
    if min(counts) < 2:
        return np.zeros(samples.shape[2])
    weights = _resampled(*counts)
    first, second = (np.tensordot(weight, half, axes=(1, 1)) for half, weight in zip(halves, weights, strict=True))
    # A resampled mean has the noise of the mean of its half twice.
    references = [_smooth(mean, 2 * _noise(half)) for mean, half in zip((first, second), halves, strict=True)]
    estimates = np.average(
        [_at_largest_of(references[1], first), _at_largest_of(references[0], second)], axis=0, weights=counts
    )
    variance = np.var(estimates, axis=0, ddof=1) * np.mean([count / (count - 1) for count in counts])
    return np.sqrt(np.maximum(variance - standard_error(magnitude) ** 2, 0.0))


def _smooth(values: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Smooth noisy values along the points.

    The result is the sum of the smoothest modes. Their number has the least expected squared error: the square of the
    removed modes less their noise, plus the noise of the retained modes (C. L. Mallows, Some comments on C_p, 1973).
    Values without noise are unchanged.

    Parameters
    ----------
    values : (..., points, channels) ndarray
        Noisy values.
    noise : (points, channels) ndarray
        Variances of the amplitudes of modes, from :func:`_noise`.

    Returns
    -------
    (..., points, channels) ndarray
        Smoothed values.
    """
    if len(noise) < FEWEST_SMOOTH or np.isnan(noise).any():
        return values
    modes = _modes(len(noise))
    amplitudes = modes.T @ values
    gain = amplitudes**2 - 2 * noise
    last = np.cumsum(gain, axis=-2).argmax(axis=-2)
    retained = np.arange(len(modes))[:, None] <= last[..., None, :]
    return modes @ (amplitudes * retained)


def _noise(samples: np.ndarray) -> np.ndarray:
    """Variance (modes, channels) of the amplitude of each mode of the mean of samples (points, replicates, channels).

    The result is NaN with one replicate.
    """
    amplitudes = np.tensordot(_modes(len(samples)), samples, axes=(0, 0))
    return standard_error(np.moveaxis(amplitudes, 1, 0)) ** 2


@kept(16)
def _modes(count: int) -> np.ndarray:
    """Orthonormal modes (points, modes) of the sum of squared second differences, the smoothest first.

    They are the modes of a bar with free ends; the first two are straight lines.
    """
    bends = np.diff(np.eye(count), 2, axis=0)
    return np.linalg.eigh(bends.T @ bends)[1]


@kept(8)
def _resampled(*counts: int) -> list[np.ndarray]:
    """Bootstrap weights (`DRAWS`, count) of the replicates of each half, for halves with ``counts`` replicates. Each
    call returns the same weights.
    """
    random = np.random.default_rng(0)
    even = [(count, np.full(count, 1 / count)) for count in counts]
    drawn = [[random.multinomial(*half) / half[0] for half in even] for _ in range(DRAWS)]
    return [np.array(weights) for weights in zip(*drawn, strict=True)]


def _at_largest_of(reference: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (..., channels) at the point where ``reference`` is largest in magnitude, multiplied by the sign of the
    reference there; from values (..., points, channels)."""
    index = np.abs(reference).argmax(axis=-2)
    return _at(values, index) * np.sign(_at(reference, index))


def _at(values: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Select values (..., channels) at the point ``index`` of each channel, from values (..., points, channels)."""
    return np.take_along_axis(values, index[..., None, :], axis=-2)[..., 0, :]
