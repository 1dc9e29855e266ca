"""Half widths of prediction intervals for a row of a new path, from errors on paths left out of a fit.

Rows of a path share errors, such as the error of a stiffer pad, so that paths are exchangeable but rows are not. Errors
are therefore ranked with the weight of their path, and the new path counts as an additional path of unlimited error (Y.
Lee, R. Barber, R. Willett, Distribution-free inference with hierarchical data, arXiv:2306.06342, section 3). This holds
for any distribution, if there are enough paths. Errors are computed here by cross-validation instead of on a separate
set of paths: the statement then holds if fits with and without a path agree.
"""

from __future__ import annotations

import math

import numpy as np

ROUNDING = 1e-9
"""Difference up to which a sum of weights counts as the coverage."""


def paths_needed(coverage: float) -> int:
    """Least number of paths from which a distribution-free prediction interval of a given coverage can be computed.

    The error of a new path is at most the largest error of n paths with a probability of n / (n + 1).

    Parameters
    ----------
    coverage : float
        Fraction of new errors that the interval should contain, above 0 and below 1.

    Returns
    -------
    int
        Number of paths, for example 9 for a coverage of 0.9.
    """
    return max(1, math.ceil(coverage / (1 - coverage) - ROUNDING))


def interval_of_paths(missed: np.ndarray, path: np.ndarray, coverage: float) -> np.ndarray:
    """Half width of a prediction interval for a row of a new path, from errors on left-out paths.

    With at least :func:`paths_needed` paths, it is the weighted quantile of the absolute errors: each path has a weight
    of 1 / (n + 1), distributed over its rows. With fewer, no finite interval holds for any distribution. The width is
    then Student's interval for n paths whose errors are normal and common to all rows of a path: left-out errors are
    n / (n - 1) times the deviations from their mean, which have n - 1 degrees of freedom. It is at least the largest
    error.

    Parameters
    ----------
    missed : (rows, quantities) ndarray
        Errors of predictions on at least two paths, which were left out of the fit.
    path : (rows,) ndarray
        Path of each row.
    coverage : float
        Fraction of the errors that the interval should contain.

    Returns
    -------
    (quantities,) ndarray
        Half widths, in the unit of the errors.
    """
    from scipy.stats import t

    _, number, count = np.unique(path, return_inverse=True, return_counts=True)
    paths, absolute = len(count), np.abs(missed)
    if paths < paths_needed(coverage):
        mean_square = (1 / (paths * count[number])) @ missed**2
        student = t.isf((1 - coverage) / 2, paths - 1) * np.sqrt(mean_square)
        return np.maximum(student, absolute.max(axis=0))
    weight = 1 / ((paths + 1) * count[number])
    order = np.argsort(absolute, axis=0)
    below = np.cumsum(weight[order], axis=0)
    rank = np.minimum((below < coverage - ROUNDING).sum(axis=0), len(missed) - 1)
    return np.take_along_axis(absolute, np.take_along_axis(order, rank[None], axis=0), axis=0)[0]


def contained_by_path(missed: np.ndarray, folds: np.ndarray, path: np.ndarray, coverage: float) -> np.ndarray:
    """Fraction of the errors of each path that lies within the prediction interval from the other folds: the observed
    coverage.

    Parameters
    ----------
    missed : (rows, quantities) ndarray
        Errors of predictions on paths that were left out of the fit.
    folds, path : (rows,) ndarray
        Fold and path of each row; at least three folds.
    coverage : float
        Fraction of the errors that the interval should contain.

    Returns
    -------
    (paths,) ndarray
        Fraction of each path, averaged over its rows and the quantities.
    """
    inside = np.empty(missed.shape)
    for fold in np.unique(folds):
        outside = folds != fold
        width = interval_of_paths(missed[outside], path[outside], coverage)
        inside[~outside] = np.abs(missed[~outside]) <= width
    return np.array([inside[path == number].mean() for number in np.unique(path)])
