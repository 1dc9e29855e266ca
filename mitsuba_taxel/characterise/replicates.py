"""The largest of many noisy numbers, from replicates that all readings of an experiment share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.replicates import standard_error

HALVES = (slice(0, None, 2), slice(1, None, 2))
DRAWS = 64
"""Samples of the bootstrap, whose standard deviation is then accurate to 9 %."""


class Largest(NamedTuple):
    """Largest in magnitude of many noisy numbers, without the bias of choosing the place.

    Attributes
    ----------
    magnitude : (replicates, channels) ndarray
        Each sample where the other half of the replicates is largest, times the sign of that half there.
    sign : (channels,) ndarray
        Sign of the mean of all samples at ``place``.
    place : (channels,) ndarray
        Place where this mean is largest.
    choice_error : (channels,) ndarray
        Standard error of the mean of ``magnitude`` due to the choice of the place.
    excess : (channels,) ndarray
        By how much the largest mean of all samples, which its own noise makes too large, exceeds the mean of
        ``magnitude``, which is too small where noise misses the largest: the largest number is between them.
    """

    magnitude: np.ndarray
    sign: np.ndarray
    place: np.ndarray
    choice_error: np.ndarray
    excess: np.ndarray

    @property
    def value(self) -> np.ndarray:
        """(channels,) the largest number, with its sign."""
        return self.sign * self.magnitude.mean(axis=0)

    def error_of(self, samples: np.ndarray) -> np.ndarray:
        """Standard error (channels,) of the mean of samples (replicates, channels) computed from :attr:`magnitude`."""
        return np.hypot(standard_error(samples), self.choice_error)


def at_largest(samples: np.ndarray) -> Largest:
    """Samples (places, replicates, channels) where they are largest; see :class:`Largest`.

    The largest of many noisy numbers is biased upwards. So each half of the replicates is evaluated where the other
    half is largest, which is independent of its own noise. Halves that choose places of opposite signs agree in the
    magnitude. As noise may choose a place that is not the largest, the estimate is low; of numbers that differ by no
    more than their noise, as slopes between neighbouring points may, by as much as ``excess``. With one replicate there
    is no other half, and the bias remains.
    """
    _, replicates, channels = samples.shape
    mean = samples.mean(axis=1)
    place = np.abs(mean).argmax(axis=0)
    sign = np.sign(_at(mean, place))
    if replicates < 2:
        return Largest(np.abs(_at(mean, place))[None], sign, place, *np.zeros((2, channels)))
    magnitude = np.empty((replicates, channels))
    for half, other in (HALVES, HALVES[::-1]):
        guide = samples[:, other].mean(axis=1)
        there = np.abs(guide).argmax(axis=0)
        chosen = samples[there, :, np.arange(channels)].T * np.sign(_at(guide, there))
        magnitude[half] = chosen[half]
    excess = np.maximum(np.abs(_at(mean, place)) - magnitude.mean(axis=0), 0.0)
    return Largest(magnitude, sign, place, _choice_error(samples, magnitude), excess)


def _choice_error(samples: np.ndarray, magnitude: np.ndarray) -> np.ndarray:
    """(channels,) standard error of the mean of ``magnitude`` due to the choice of the place.

    Each half's noise chooses where the other is evaluated, so the halves are too large, or too small, together. The
    bootstrap captures that (B. Efron, R. Tibshirani, An Introduction to the Bootstrap, 1993, chapter 6): each half's
    replicates are resampled with replacement, and the estimate repeated. Its variance is (n - 1) / n of that of the
    mean of n.
    """
    parts = [samples[:, half] for half in HALVES]
    counts = [part.shape[1] for part in parts]
    if min(counts) < 2:
        return np.zeros(samples.shape[2])
    weights = _resampled(*counts)
    one, other = (np.tensordot(weight, part, axes=(1, 1)) for part, weight in zip(parts, weights, strict=True))
    found = np.average([_read(one, other), _read(other, one)], axis=0, weights=counts)
    variance = np.var(found, axis=0, ddof=1) * np.mean([count / (count - 1) for count in counts])
    return np.sqrt(np.maximum(variance - standard_error(magnitude) ** 2, 0.0))


@kept(8)
def _resampled(*counts: int) -> list[np.ndarray]:
    """Of each half of the replicates, as many as `counts`: (DRAWS, count) weights, the same each time."""
    random = np.random.default_rng(0)
    even = [(count, np.full(count, 1 / count)) for count in counts]
    drawn = [[random.multinomial(*half) / half[0] for half in even] for _ in range(DRAWS)]
    return [np.array(weights) for weights in zip(*drawn, strict=True)]


def _read(values: np.ndarray, guide: np.ndarray) -> np.ndarray:
    """(..., channels) values (..., places, channels) where ``guide`` is largest in magnitude, times its sign there."""
    place = np.abs(guide).argmax(axis=-2)
    return _at(values, place) * np.sign(_at(guide, place))


def _at(values: np.ndarray, place: np.ndarray) -> np.ndarray:
    """(..., channels) values (..., places, channels), each at its channel's place."""
    return np.take_along_axis(values, place[..., None, :], axis=-2)[..., 0, :]
