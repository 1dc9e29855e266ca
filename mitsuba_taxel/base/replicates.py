"""Estimates from independent replicates."""

from __future__ import annotations

import math

import numpy as np

MOST_OF_SCATTER = 0.5
"""Contribution of one replicate to the scatter above which large values are rare, so that `standard_error` is
uncertain: of 32 replicates with a normal distribution, one contributes more than half in 1 of 8600 cases."""


def standard_error(replicates: np.ndarray, axis: int = 0) -> np.ndarray:
    """Standard error of the mean over replicates, from their scatter.

    The result is exactly 0 if all replicates are equal, and NaN for a single replicate.

    Parameters
    ----------
    replicates : ndarray
        Independent estimates of the same values, of any shape.
    axis : int
        Axis of the replicates.

    Returns
    -------
    ndarray
        Standard errors, in the unit of the replicates and without the axis of the replicates.
    """
    count = replicates.shape[axis]
    if count < 2:
        return np.full(np.delete(replicates.shape, axis), np.nan)
    first = np.take(replicates, [0], axis=axis)
    return (replicates - first).std(axis=axis, ddof=1) / math.sqrt(count)


def largest_scatter_share(replicates: np.ndarray, axis: int = 0) -> np.ndarray:
    """Largest fraction of the scatter of replicates that is due to a single replicate; see `MOST_OF_SCATTER`.

    The scatter is the sum of squared deviations from the mean; the replicate with the largest deviation counts.

    Parameters
    ----------
    replicates : ndarray
        Independent estimates of the same values, of any shape.
    axis : int
        Axis of the replicates.

    Returns
    -------
    ndarray
        Fractions from 0 to 1, without the axis of the replicates; 0 if all replicates are equal.
    """
    squares = (replicates - replicates.mean(axis=axis, keepdims=True)) ** 2
    total = squares.sum(axis=axis)
    # The mean of equal replicates differs from them by rounding.
    varies = np.ptp(replicates, axis=axis) > 0
    return np.divide(squares.max(axis=axis), total, out=np.zeros_like(total), where=varies & (total > 0))
