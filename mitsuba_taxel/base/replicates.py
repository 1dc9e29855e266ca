"""Estimates from independent replicates."""

from __future__ import annotations

import math

import numpy as np


def standard_error(replicates: np.ndarray, axis: int = 0) -> np.ndarray:
    """One standard deviation of the mean over the replicates along ``axis``, from their scatter.

    It is exactly 0 if all are equal, and NaN if there is only one.

    Parameters
    ----------
    replicates : ndarray
        Independent estimates of the same values, of any shape.
    axis : int
        Along which they are.

    Returns
    -------
    ndarray
        In the unit of the replicates, without that axis.
    """
    count = replicates.shape[axis]
    if count < 2:
        return np.full(np.delete(replicates.shape, axis), np.nan)
    first = np.take(replicates, [0], axis=axis)
    return (replicates - first).std(axis=axis, ddof=1) / math.sqrt(count)
