"""Agreement of two sets of numbers for the four cell shapes, in their order and their ratios."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

DRAWS = 100_000


class ShapeOrder(NamedTuple):
    """The cell shapes from the largest value to the smallest, with the probability of this order.

    Attributes
    ----------
    certainty : float
        Probability that the true values are in this order, if errors are normal and independent.
    """

    names: tuple[str, ...]
    certainty: float


def order(values: Mapping[str, float], errors: Mapping[str, float]) -> ShapeOrder:
    """Sort the cell shapes by their values, from the largest to the smallest, and compute the probability of this order
    from the standard errors."""
    names = tuple(sorted(values, key=lambda name: -values[name]))
    mean = np.array([values[name] for name in names])
    error = np.array([errors[name] for name in names])
    draws = np.random.default_rng(0).normal(mean, error, (DRAWS, len(names)))
    return ShapeOrder(names, float(np.mean(np.all(np.diff(draws, axis=1) < 0, axis=1))))


def pairs_in_order(values: Mapping[str, float], references: Mapping[str, float]) -> tuple[int, int]:
    """Count the pairs of shapes that have the same order in both sets of values. Returns this number and that of all
    pairs."""
    pairs = list(combinations([name for name in values if name in references], 2))
    count = sum(
        (values[first] - values[second]) * (references[first] - references[second]) > 0 for first, second in pairs
    )
    return count, len(pairs)


class CommonFactorFit(NamedTuple):
    """Fit of numbers as a common factor times expected values.

    Attributes
    ----------
    scale : float
        The common factor.
    scale_error : float
        Standard error of the factor.
    chi_square, freedom, p : float and int
        Sum of squared deviations divided by their variances, degrees of freedom, and p-value.
    misfit : float
        Typical ratio between a number and its fit: exp of the root mean square of ln(number / (scale x expected)).
    """

    scale: float
    scale_error: float
    chi_square: float
    freedom: int
    p: float
    misfit: float


def common_scale(numbers: np.ndarray, expected: np.ndarray, spread: np.ndarray) -> CommonFactorFit:
    """Fit ``numbers`` = scale x ``expected``, whose relative standard deviations are ``spread``.

    The fit uses logarithms, to first order in the spread; numbers and expected values must be above 0.
    """
    difference = np.log(numbers / expected)
    weights = 1 / np.asarray(spread) ** 2
    shift = float(np.average(difference, weights=weights))
    residual = difference - shift
    chi_square = float(np.sum(weights * residual**2))
    freedom = len(residual) - 1
    error = math.exp(shift) / math.sqrt(weights.sum())
    centred = difference - difference.mean()
    misfit = math.exp(math.sqrt(float(np.mean(centred**2))))
    return CommonFactorFit(math.exp(shift), error, chi_square, freedom, float(chi2.sf(chi_square, freedom)), misfit)
