"""Shares of parameters in the spread of a figure: Sobol' indices of a polynomial fitted to the samples."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.tolerances.laws import Law

DRAWS = 2**12
"""Evaluations of the polynomial; indices are accurate to about 0.01."""
ENOUGH = 0.8
"""Least share of the variance that the polynomial explains for its indices to be known."""
RESAMPLES = 32
"""Fits behind the errors of indices, which they leave uncertain by 13 %."""
SPARE = 1.5
"""Least samples per coefficient."""


@dataclass(frozen=True, eq=False)
class ResponseSurface:
    """Polynomial least-squares fit to samples of several outputs.

    Attributes
    ----------
    powers : (terms, parameters) ndarray
    coefficients : (terms, outputs) ndarray
    explained : (outputs,) ndarray
        Share of the variance predicted for samples left out one by one.
    redrawn : (resamples, terms, outputs) ndarray
        Coefficients of fits to outputs whose residuals are drawn anew.
    """

    powers: np.ndarray
    coefficients: np.ndarray
    explained: np.ndarray
    redrawn: np.ndarray

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """(N, outputs) at standardised parameters (N, parameters)."""
        return _design(z, self.powers) @ self.coefficients


def fitted(z: np.ndarray, outputs: np.ndarray) -> ResponseSurface | None:
    """The polynomial fit to samples (N, parameters) and their outputs (N, outputs) that predicts best: of first degree,
    with squares, or of second degree. None if there are too few samples."""
    found = [_least_squares(z, outputs, powers) for powers in _degrees(z.shape[1]) if len(z) >= SPARE * len(powers)]
    return max(found, key=lambda one: float(np.mean(one.explained)), default=None)


def fewest_of(parameters: int) -> int:
    """The fewest samples through which a polynomial is fitted."""
    return math.ceil(SPARE * (1 + parameters))


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


def indices(polynomial: ResponseSurface, laws: Sequence[Law], seed: int) -> Indices:
    """Indices of what a polynomial was fitted to."""
    resamples, terms, outputs = polynomial.redrawn.shape
    redrawn = polynomial.redrawn.transpose(1, 0, 2).reshape(terms, -1)
    every = replace(polynomial, coefficients=np.hstack([polynomial.coefficients, redrawn]))
    found = np.array(_indices(every, laws, seed)).reshape(2, resamples + 1, outputs, len(laws))
    spread = np.std(found[:, 1:], axis=1, ddof=1)
    missed = np.clip(1 - polynomial.explained, 0.0, 1.0)[:, None] / 2
    error = np.where(np.isfinite(found[:, 0]), np.hypot(np.nan_to_num(spread), missed), math.nan)
    known = np.where((polynomial.explained >= ENOUGH)[:, None], 1.0, math.nan)
    return Indices(*(values * known for values in (*found[:, 0], *error)))


def _indices(polynomial: ResponseSurface, laws: Sequence[Law], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """First and total Sobol' indices (outputs, parameters) of the polynomial; NaN if nothing varies."""
    from scipy.stats import qmc, sobol_indices

    count = len(laws)
    draws = qmc.Sobol(2 * count, seed=np.random.default_rng(seed)).random(DRAWS)
    columns = [law.standardised(column) for law, column in zip([*laws, *laws], draws.T, strict=True)]
    z = np.stack(columns, axis=1)
    one, other = z[:, :count], z[:, count:]
    mixed = [np.where(np.arange(count) == number, other, one) for number in range(count)]
    a, b, *ab = (polynomial(each).T for each in (one, other, *mixed))
    varies = a.var(axis=1) > 1e-20 * np.mean(a**2, axis=1)
    first, total = np.full((2, len(a), count), np.nan)
    if count == 1:  # scipy 1.17 fails for one
        first[varies] = total[varies] = 1.0
    elif varies.any():
        parts: Any = {"f_A": a[varies], "f_B": b[varies], "f_AB": np.stack(ab)[:, varies]}
        found = sobol_indices(func=parts, n=DRAWS)
        first[varies], total[varies] = found.first_order, found.total_order
    return first, total


def _degrees(parameters: int) -> Iterator[np.ndarray]:
    """Powers (terms, parameters) of polynomials with increasing numbers of terms."""
    unit = np.eye(parameters, dtype=int)
    linear = [np.zeros(parameters, dtype=int), *unit]
    yield np.array(linear)
    yield np.array([*linear, *(2 * unit)])
    if parameters > 1:
        yield np.array([*linear, *(2 * unit), *(one + other for one, other in combinations(unit, 2))])


def _design(z: np.ndarray, powers: np.ndarray) -> np.ndarray:
    return np.prod(z[:, None, :] ** powers, axis=2)


def _least_squares(z: np.ndarray, outputs: np.ndarray, powers: np.ndarray) -> ResponseSurface:
    design = _design(z, powers)
    orthogonal, upper = np.linalg.qr(design)
    coefficients = np.linalg.lstsq(upper, orthogonal.T @ outputs, rcond=None)[0]
    leverage = np.square(orthogonal).sum(axis=1)[:, None]
    left_out = (outputs - design @ coefficients) / np.maximum(1 - leverage, 1e-12)
    variance = np.square(outputs - outputs.mean(axis=0)).sum(axis=0)
    missed = np.divide(np.square(left_out).sum(axis=0), variance, out=np.zeros_like(variance), where=variance > 0)
    drawn = np.random.default_rng(0).integers(len(z), size=(RESAMPLES, len(z)))
    # Those of the left-out samples, which a fit has not made smaller.
    again = np.linalg.lstsq(upper, orthogonal.T @ left_out[drawn].transpose(1, 0, 2).reshape(len(z), -1), rcond=None)[0]
    redrawn = coefficients + again.reshape(powers.shape[0], RESAMPLES, -1).transpose(1, 0, 2)
    return ResponseSurface(powers, coefficients, 1 - missed, redrawn)
