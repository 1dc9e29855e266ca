"""Estimates from independent replicates."""

from __future__ import annotations

import math

import numpy as np


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
        Standard errors, in the unit of the replicates and without that axis.
    """
    count = replicates.shape[axis]
    if count < 2:
        return np.full(np.delete(replicates.shape, axis), np.nan)
    first = np.take(replicates, [0], axis=axis)
    return (replicates - first).std(axis=axis, ddof=1) / math.sqrt(count)
