"""Shares of parameters in the spread of a figure: Sobol' indices of a polynomial fitted to the samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander

from mitsuba_taxel.tolerances.laws import Law

NODES, TAIL = 1001, 1e-4
"""Of the quadrature by a parameter, and the probability that it leaves out on each side."""
ENOUGH = 0.8
"""Least share of the variance that the polynomial explains for its indices to be known."""
RESAMPLES = 32
"""Fits behind the errors of indices, which they leave uncertain by 13 %."""
SPARE = 1.5
"""Least samples per coefficient."""
HIGHEST_DEGREE, MOST_TERMS, MOST_OF_SECOND = 10, 400, 1000
"""Of polynomials: the largest degree, and the most terms, also of those of first and second degree."""
HYPERBOLIC = 0.75
"""Norm of the degrees that leaves out most products of several parameters, of which few matter (G. Blatman, B. Sudret,
Adaptive sparse polynomial chaos expansion based on least angle regression, J. Comput. Phys. 230, 2011)."""
EXACT = 1e-9
"""Share of the variance that rounding may leave: a polynomial that misses less is not improved."""


@dataclass(frozen=True, eq=False)
class ResponseSurface:
    """Polynomial least-squares fit to samples of several outputs.

    Attributes
    ----------
    degrees : (terms, parameters) ndarray
        Degrees of the Legendre polynomials whose product a term is.
    reach : (parameters,) ndarray
        Standardised parameters at which their argument is 1.
    coefficients : (terms, outputs) ndarray
    explained : (outputs,) ndarray
        Share of the variance predicted for samples left out one by one.
    redrawn : (resamples, terms, outputs) ndarray
        Coefficients of fits to outputs whose residuals are drawn anew.
    """

    degrees: np.ndarray
    reach: np.ndarray
    coefficients: np.ndarray
    explained: np.ndarray
    redrawn: np.ndarray

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """(N, outputs) at standardised parameters (N, parameters)."""
        return _design(z / self.reach, self.degrees) @ self.coefficients


def fitted(z: np.ndarray, outputs: np.ndarray) -> ResponseSurface | None:
    """The polynomial that predicts best, of any degree for which there are enough samples.

    Parameters
    ----------
    z : (N, parameters) ndarray
        Samples.
    outputs : (N, outputs) ndarray
        Their outputs.

    Returns
    -------
    ResponseSurface or None
        None if there are too few samples.
    """
    reach = np.maximum(np.abs(z).max(axis=0, initial=0.0), 1e-300)
    best, missed = None, math.inf
    for degrees in _bases(z.shape[1], int(len(z) / SPARE)):
        if missed > EXACT:
            fit = _LeastSquares(_design(z / reach, degrees), outputs)
            if fit.missed.mean() < missed:
                best, missed = (degrees, fit), fit.missed.mean()
    if best is None:
        return None
    degrees, fit = best
    return ResponseSurface(degrees, reach, fit.coefficients, 1 - fit.missed, fit.redrawn())


def fewest_of(parameters: int) -> int:
    """The fewest samples through which a polynomial is fitted."""
    return math.ceil(SPARE * (1 + parameters))


def more_samples(parameters: int, count: int) -> tuple[int, int] | None:
    """The fewest samples beyond ``count`` through which another polynomial is fitted, and its degree; None if there is
    no other."""
    terms = int(count / SPARE)
    larger = [degrees for degrees in _bases(parameters, MOST_OF_SECOND) if len(degrees) > terms]
    return (math.ceil(SPARE * len(larger[0])), int(larger[0].sum(axis=1).max())) if larger else None


class Indices(NamedTuple):
    """First and total Sobol' indices (outputs, parameters), and their standard errors; NaN if nothing varies, or the
    polynomial explains less than ENOUGH of the variance.

    Errors are those of the coefficients, by a bootstrap of the residuals (B. Efron, R. Tibshirani, An Introduction to
    the Bootstrap, 1993, section 9.4), and half of the share that is not explained, which may be anyone's.
    """

    first: np.ndarray
    total: np.ndarray
    first_error: np.ndarray
    total_error: np.ndarray


def indices(polynomial: ResponseSurface, laws: Sequence[Law]) -> Indices:
    """Sobol' indices of what a polynomial was fitted to.

    Parameters
    ----------
    polynomial : ResponseSurface
        Of :func:`fitted`.
    laws : sequence of Law
        Of the parameters.

    Returns
    -------
    Indices
        First and total ones and their errors; NaN where too little is explained.
    """
    resamples, terms, outputs = polynomial.redrawn.shape
    redrawn = polynomial.redrawn.transpose(1, 0, 2).reshape(terms, -1)
    every = replace(polynomial, coefficients=np.hstack([polynomial.coefficients, redrawn]))
    found = np.array(_indices(every, laws)).reshape(2, resamples + 1, outputs, len(laws))
    spread = np.std(found[:, 1:], axis=1, ddof=1)
    missed = np.clip(1 - polynomial.explained, 0.0, 1.0)[:, None] / 2
    error = np.where(np.isfinite(found[:, 0]), np.hypot(np.nan_to_num(spread), missed), math.nan)
    known = np.where((polynomial.explained >= ENOUGH)[:, None], 1.0, math.nan)
    return Indices(*(values * known for values in (*found[:, 0], *error)))


def _indices(polynomial: ResponseSurface, laws: Sequence[Law]) -> tuple[np.ndarray, np.ndarray]:
    """First and total Sobol' indices (outputs, parameters) of the polynomial; NaN if nothing varies.

    Variances of conditional means are quadratic forms of the coefficients: expectations of products of two terms are
    products over the parameters, of the mean of a product where a parameter varies, and of the product of means where
    it is averaged out.
    """
    varying, averaged = [], []
    for law, reach, degrees in zip(laws, polynomial.reach, polynomial.degrees.T, strict=True):
        values, weights = _quadrature(law)
        basis = legvander(values / reach, degrees.max())[:, degrees]
        mean = weights @ basis
        varying.append((basis * weights[:, None]).T @ basis)
        averaged.append(np.outer(mean, mean))

    def square(which: Sequence[bool]) -> np.ndarray:
        """Mean square (outputs,) of the mean by the parameters that do not vary."""
        pairs = [one if varies else other for one, other, varies in zip(varying, averaged, which, strict=True)]
        return np.einsum("io,io->o", polynomial.coefficients, np.prod(pairs, axis=0) @ polynomial.coefficients)

    count = len(laws)
    whole, constant = square([True] * count), square([False] * count)
    variance = whole - constant
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(variance > 1e-20 * whole, 1 / variance, math.nan)
    single = [[number == other for other in range(count)] for number in range(count)]
    first = np.stack([(square(which) - constant) * factor for which in single], axis=1)
    total = np.stack([(whole - square([not one for one in which])) * factor for which in single], axis=1)
    return first, total


def _quadrature(law: Law) -> tuple[np.ndarray, np.ndarray]:
    """Standardised values of a parameter, and their weights: the trapezoidal rule for a normal variable of which it is
    a function, without its tails, where no sample lies and polynomials are of no use."""
    from scipy.stats import norm

    normal = np.linspace(norm.ppf(TAIL), norm.isf(TAIL), NODES)
    weights = norm.pdf(normal)
    return law.standardised(norm.cdf(normal)), weights / weights.sum()


def _bases(parameters: int, most: int) -> list[np.ndarray]:
    """Degrees (terms, parameters) of the terms of polynomials with at most so many, by increasing number of terms."""
    found: dict[int, np.ndarray] = {}
    for degree in range(1, HIGHEST_DEGREE + 1):
        limit = min(most, MOST_OF_SECOND if degree <= 2 else MOST_TERMS)
        for norm in (1.0, HYPERBOLIC):
            degrees = _index_set(parameters, degree, norm, limit)
            if degrees is not None:
                found.setdefault(len(degrees), degrees)
    return [found[count] for count in sorted(found)]


def _index_set(parameters: int, degree: int, norm: float, most: int) -> np.ndarray | None:
    """All degrees whose norm does not exceed ``degree``; None if they are more than ``most``."""
    bound = degree**norm + 1e-9
    found: list[tuple[tuple[int, ...], float]] = [((), 0.0)]
    for _ in range(parameters):
        found = [
            ((*powers, power), used + power**norm)
            for powers, used in found
            for power in range(degree + 1)
            if used + power**norm <= bound
        ]
        if len(found) > most:
            return None
    return np.array([powers for powers, _ in found])


def _design(x: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """(N, terms) at arguments (N, parameters)."""
    design = np.ones((len(x), len(degrees)))
    for column, powers in zip(x.T, degrees.T, strict=True):
        design *= legvander(column, powers.max())[:, powers]
    return design


class _LeastSquares:
    """A fit of outputs (N, outputs) by a design (N, terms).

    Attributes
    ----------
    coefficients : (terms, outputs) ndarray
    missed : (outputs,) ndarray
        Share of the variance not predicted for samples left out one by one; 0 of outputs that do not vary.
    """

    def __init__(self, design: np.ndarray, outputs: np.ndarray) -> None:
        self._orthogonal, self._upper = np.linalg.qr(design)
        self.coefficients = self._solved(outputs)
        leverage = np.square(self._orthogonal).sum(axis=1)[:, None]
        self._left_out = (outputs - design @ self.coefficients) / np.maximum(1 - leverage, 1e-12)
        variance = np.square(outputs - outputs.mean(axis=0)).sum(axis=0)
        square = np.square(self._left_out).sum(axis=0)
        self.missed = np.divide(square, variance, out=np.zeros_like(variance), where=variance > 0)

    def redrawn(self) -> np.ndarray:
        """Coefficients (resamples, terms, outputs) with residuals drawn anew from those of the left-out samples, which
        a fit has not made smaller."""
        count, outputs = self._left_out.shape
        drawn = np.random.default_rng(0).integers(count, size=(RESAMPLES, count))
        again = self._solved(self._left_out[drawn].transpose(1, 0, 2).reshape(count, -1))
        return self.coefficients + again.reshape(-1, RESAMPLES, outputs).transpose(1, 0, 2)

    def _solved(self, outputs: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(self._upper, self._orthogonal.T @ outputs, rcond=None)[0]
