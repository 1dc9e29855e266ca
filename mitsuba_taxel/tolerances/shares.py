"""Shares of parameters in the spread of a figure: Sobol' indices of a polynomial fitted to the samples."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from mitsuba_taxel.tolerances.laws import Law

DRAWS = 2**12
"""Evaluations of the polynomial; indices are accurate to about 0.01."""
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
    """

    powers: np.ndarray
    coefficients: np.ndarray
    explained: np.ndarray

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


def indices(polynomial: ResponseSurface, laws: Sequence[Law], seed: int) -> tuple[np.ndarray, np.ndarray]:
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
    return ResponseSurface(powers, coefficients, 1 - missed)
