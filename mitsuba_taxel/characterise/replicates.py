"""Estimates and their errors from replicates that all readings of an experiment share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

HALVES = (slice(0, None, 2), slice(1, None, 2))


class Largest(NamedTuple):
    """Samples (replicates, channels), each read where the other half of the replicates is largest in magnitude.

    ``signs`` (replicates, channels) are those that the other half has there; ``moved`` (channels,) says whether the
    halves chose different places; ``place`` (channels,) is where the mean of all is largest.
    """

    samples: np.ndarray
    signs: np.ndarray
    moved: np.ndarray
    place: np.ndarray


def standard_error(samples: np.ndarray, axis: int = 0) -> np.ndarray:
    """Standard error of the mean over the replicates along ``axis``; not a number where there is only one."""
    count = samples.shape[axis]
    if count < 2:
        return np.full(np.delete(samples.shape, axis), np.nan)
    return samples.std(axis=axis, ddof=1) / np.sqrt(count)


def at_largest(samples: np.ndarray) -> Largest:
    """Samples (places, replicates, channels) where they are largest, without the bias of choosing this place.

    The largest of many noisy numbers is too large. So each half of the replicates is read where the other half
    is largest, which says nothing about its own noise. What this leaves is that noise may choose a place that is not
    the largest: the estimate is low by less than its error (:func:`error_at_largest`). With one replicate there is
    no other half, and the bias stays.
    """
    _, replicates, channels = samples.shape
    every = np.arange(channels)
    if replicates < 2:
        place = np.abs(samples[:, 0]).argmax(axis=0)
        chosen = samples[place, 0, every][None]
        return Largest(chosen, np.sign(chosen), np.zeros(channels, bool), place)
    chosen, signs, places = np.empty((replicates, channels)), np.empty((replicates, channels)), []
    for half, other in (HALVES, HALVES[::-1]):
        guide = samples[:, other].mean(axis=1)
        place = np.abs(guide).argmax(axis=0)
        chosen[half] = samples[place, :, every].T[half]
        signs[half] = np.sign(guide[place, every])
        places.append(place)
    return Largest(chosen, signs, places[0] != places[1], np.abs(samples.mean(axis=1)).argmax(axis=0))


def error_at_largest(samples: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Standard error (channels,) of the mean of samples that :func:`at_largest` has chosen.

    Where the halves chose different places, how far their means are apart tells what the choice adds; the scatter
    of the samples alone would be too small by up to a half.
    """
    if len(samples) < 2:
        return standard_error(samples)
    one, other = (samples[half].mean(axis=0) for half in HALVES)
    return np.hypot(standard_error(samples), np.where(moved, (one - other) / 2, 0))
