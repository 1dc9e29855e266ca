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
"""Number of nodes of the quadrature over a parameter, and the probability that it omits on each side."""
ENOUGH = 0.8
"""Least share of the variance that a polynomial must explain for its indices to be stated."""
RESAMPLES = 32
"""Number of fits for the errors of indices, which then have an uncertainty of 13 %."""
SPARE = 1.5
"""Least number of samples per coefficient."""
HIGHEST_DEGREE, MOST_TERMS, MOST_OF_SECOND = 10, 400, 1000
"""Largest degree of a polynomial; its largest number of terms; the same for first and second degree."""
HYPERBOLIC = 0.75
"""Exponent of the norm of degrees that omits most products of several parameters (G. Blatman, B. Sudret,
Adaptive sparse polynomial chaos expansion based on least angle regression, J. Comput. Phys. 230, 2011)."""
EXACT = 1e-9
"""Unexplained share of the variance, due to rounding, below which a polynomial is not improved."""


@dataclass(frozen=True, eq=False)
class ResponseSurface:
    """Polynomial in the standardised parameters, fitted by least squares to samples of several outputs.

    Attributes
    ----------
    degrees : (terms, parameters) ndarray
        Degrees of the Legendre polynomials whose product is a term.
    reach : (parameters,) ndarray
        Values of the standardised parameters at which the argument of the Legendre polynomials is 1.
    coefficients : (terms, outputs) ndarray
        Coefficients of the fit.
    explained : (outputs,) ndarray
        Share of the variance that is predicted in leave-one-out cross-validation.
    redrawn : (resamples, terms, outputs) ndarray
        Coefficients of repeated fits, to outputs with resampled residuals (bootstrap).
    """

    degrees: np.ndarray
    reach: np.ndarray
    coefficients: np.ndarray
    explained: np.ndarray
    redrawn: np.ndarray

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Outputs (N, outputs) at standardised parameters (N, parameters)."""
        return _design(z / self.reach, self.degrees) @ self.coefficients


def fitted(z: np.ndarray, outputs: np.ndarray) -> ResponseSurface | None:
    """Fit a polynomial to the samples. Its degree is that with the best predictions, among the degrees for which there
    are enough samples.

    Parameters
    ----------
    z : (N, parameters) ndarray
        Standardised parameters of N samples.
    outputs : (N, outputs) ndarray
        Outputs of the samples.

    Returns
    -------
    ResponseSurface or None
        None if there are too few samples for any polynomial.
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
    """Smallest number of samples to which a polynomial in this number of parameters can be fitted."""
    return math.ceil(SPARE * (1 + parameters))


def more_samples(parameters: int, count: int) -> tuple[int, int] | None:
    """The least number of samples beyond ``count`` to which a larger polynomial is fitted, and its degree.

    None if there is no larger polynomial.
    """
    terms = int(count / SPARE)
    larger = [degrees for degrees in _bases(parameters, MOST_OF_SECOND) if len(degrees) > terms]
    return (math.ceil(SPARE * len(larger[0])), int(larger[0].sum(axis=1).max())) if larger else None


class SobolIndices(NamedTuple):
    """First-order and total Sobol' indices (outputs, parameters), and their standard errors.

    They are NaN for an output that does not vary, or of whose variance the polynomial explains less than `ENOUGH`.
    Errors are those of the coefficients, by a bootstrap of the residuals (B. Efron, R. Tibshirani, An Introduction to
    the Bootstrap, 1993, section 9.4), combined with half of the unexplained fraction of the variance, which may be due
    to any parameter.
    """

    first: np.ndarray
    total: np.ndarray
    first_error: np.ndarray
    total_error: np.ndarray


def indices(polynomial: ResponseSurface, laws: Sequence[Law]) -> SobolIndices:
    """Sobol' indices of the outputs of a fitted polynomial.

    Parameters
    ----------
    polynomial : ResponseSurface
        Polynomial of :func:`fitted`.
    laws : sequence of Law
        Distributions of the parameters.

    Returns
    -------
    SobolIndices
        First and total indices and their errors; NaN where the polynomial explains too little.
    """
    # Indices of the fit, and of the fits to resampled residuals.
    resamples, terms, outputs = polynomial.redrawn.shape
    redrawn = polynomial.redrawn.transpose(1, 0, 2).reshape(terms, -1)
    every = replace(polynomial, coefficients=np.hstack([polynomial.coefficients, redrawn]))
    estimates = np.array(_indices(every, laws)).reshape(2, resamples + 1, outputs, len(laws))
    spread = np.std(estimates[:, 1:], axis=1, ddof=1)
    missed = np.clip(1 - polynomial.explained, 0.0, 1.0)[:, None] / 2
    error = np.where(np.isfinite(estimates[:, 0]), np.hypot(np.nan_to_num(spread), missed), math.nan)
    mask = np.where((polynomial.explained >= ENOUGH)[:, None], 1.0, math.nan)
    return SobolIndices(*(values * mask for values in (*estimates[:, 0], *error)))


def _indices(polynomial: ResponseSurface, laws: Sequence[Law]) -> tuple[np.ndarray, np.ndarray]:
    """First and total Sobol' indices (outputs, parameters) of the polynomial; NaN if nothing varies.

    Variances of conditional means are quadratic forms of the coefficients. Their matrices are products over the
    parameters: of the means of products of two basis functions if the parameter varies, and of the products of their
    means if it is averaged out.
    """
    varying, averaged = [], []
    for law, reach, degrees in zip(laws, polynomial.reach, polynomial.degrees.T, strict=True):
        values, weights = _quadrature(law)
        basis = legvander(values / reach, degrees.max())[:, degrees]
        mean = weights @ basis
        varying.append((basis * weights[:, None]).T @ basis)
        averaged.append(np.outer(mean, mean))

    def square(which: Sequence[bool]) -> np.ndarray:
        """Mean square (outputs,) of the output, averaged over all parameters except those selected by ``which``."""
        pairs = [
            varying_product if varies else averaged_product
            for varying_product, averaged_product, varies in zip(varying, averaged, which, strict=True)
        ]
        return np.einsum("io,io->o", polynomial.coefficients, np.prod(pairs, axis=0) @ polynomial.coefficients)

    count = len(laws)
    mean_square, constant = square([True] * count), square([False] * count)
    variance = mean_square - constant
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(variance > 1e-20 * mean_square, 1 / variance, math.nan)
    single = [[number == column for column in range(count)] for number in range(count)]
    first = np.stack([(square(which) - constant) * factor for which in single], axis=1)
    total = np.stack([(mean_square - square([not varies for varies in which])) * factor for which in single], axis=1)
    return first, total


def _quadrature(law: Law) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of a quadrature over a standardised parameter.

    It is the trapezoidal rule for a normal variable, of which the parameter is a function, without the tails: no sample
    lies there, and polynomials would extrapolate.
    """
    from scipy.stats import norm

    normal = np.linspace(norm.ppf(TAIL), norm.isf(TAIL), NODES)
    weights = norm.pdf(normal)
    return law.standardised(norm.cdf(normal)), weights / weights.sum()


def _bases(parameters: int, most: int) -> list[np.ndarray]:
    """Yield the degrees (terms, parameters) of polynomials with at most ``most`` terms, by increasing number of
    terms."""
    by_count: dict[int, np.ndarray] = {}
    for degree in range(1, HIGHEST_DEGREE + 1):
        limit = min(most, MOST_OF_SECOND if degree <= 2 else MOST_TERMS)
        for norm in (1.0, HYPERBOLIC):
            degrees = _index_set(parameters, degree, norm, limit)
            if degrees is not None:
                by_count.setdefault(len(degrees), degrees)
    return [by_count[count] for count in sorted(by_count)]


def _index_set(parameters: int, degree: int, norm: float, most: int) -> np.ndarray | None:
    """Degrees (terms, parameters) whose norm is at most ``degree``; None if there are more than ``most`` terms."""
    bound = degree**norm + 1e-9
    index_set: list[tuple[tuple[int, ...], float]] = [((), 0.0)]
    for _ in range(parameters):
        index_set = [
            ((*powers, power), used + power**norm)
            for powers, used in index_set
            for power in range(degree + 1)
            if used + power**norm <= bound
        ]
        if len(index_set) > most:
            return None
    return np.array([powers for powers, _ in index_set])


def _design(x: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Design matrix (N, terms): products of Legendre polynomials at arguments (N, parameters)."""
    design = np.ones((len(x), len(degrees)))
    for column, powers in zip(x.T, degrees.T, strict=True):
        design *= legvander(column, powers.max())[:, powers]
    return design


class _LeastSquares:
    """Least-squares fit of outputs (N, outputs) with a design matrix (N, terms).

    Attributes
    ----------
    coefficients : (terms, outputs) ndarray
        Coefficients of the fit.
    missed : (outputs,) ndarray
        Share of the variance not predicted in leave-one-out cross-validation; 0 for outputs that do not vary.
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
        """Coefficients (resamples, terms, outputs) of repeated fits to outputs with resampled residuals (bootstrap).

        The residuals are those of leave-one-out predictions, because the fit makes its own residuals smaller.
        """
        count, outputs = self._left_out.shape
        drawn = np.random.default_rng(0).integers(count, size=(RESAMPLES, count))
        again = self._solved(self._left_out[drawn].transpose(1, 0, 2).reshape(count, -1))
        return self.coefficients + again.reshape(-1, RESAMPLES, outputs).transpose(1, 0, 2)

    def _solved(self, outputs: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(self._upper, self._orthogonal.T @ outputs, rcond=None)[0]
