"""Weighted least squares with bounds, confidence intervals, and detection of undetermined unknowns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.fitting.plan import Unknown

ALIKE = 0.98
"""Correlation above which two unknowns count as indistinguishable."""
RANK = 1e-7
"""Singular value, relative to the largest, below which a direction is undetermined."""
CONFIDENCE = 0.95
UNLIKELY = 0.01
"""Probability of larger residuals below which model or errors count as wrong."""
MOST_STEPS = 25
EXACT = 1e-7
"""Residual, relative to the largest reading, below which nothing is left to fit: along undetermined directions steps
may go on, depending on rounding."""


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Solution of least squares.

    Attributes
    ----------
    values, errors : (unknowns,) ndarray
        The unknowns, and one standard deviation of each by the data; infinite if undetermined.
    half_width : (unknowns,) ndarray
        Of the 95 % confidence interval by the data, by Student's distribution if errors come from the residuals.
    correlation : (unknowns, unknowns) ndarray
    by_reading : (unknowns, N) ndarray
        Change of each unknown with each reading; NaN of undetermined ones.
    model : (N,) ndarray
    misfit : float
        Sum of squared residuals over their errors, per degree of freedom: 1 if the model and the errors are right.
        Without errors of the data, the mean square itself.
    degrees_of_freedom : int
    warnings : list[str]
    """

    values: np.ndarray
    errors: np.ndarray
    half_width: np.ndarray
    correlation: np.ndarray
    by_reading: np.ndarray
    model: np.ndarray
    misfit: float
    degrees_of_freedom: int
    warnings: list[str]


def solve(
    model: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    data: np.ndarray,
    errors: np.ndarray | None,
    unknowns: Sequence[Unknown],
) -> LeastSquares:
    """Estimate the unknowns of a model.

    Parameters
    ----------
    model : Callable
        From unknowns to readings (N,) and their derivatives (N, unknowns).
    data : (N,) ndarray
        Measured readings.
    errors : (N,) ndarray, optional
        Their standard deviations. Without, all readings have equal weight, and the error is estimated from the
        residuals.
    unknowns : Sequence[Unknown]
        Initial values and bounds.

    Returns
    -------
    LeastSquares
        Estimates with their errors and correlation.
    """
    from scipy.optimize import least_squares
    from scipy.stats import norm, t

    names = [unknown.name for unknown in unknowns]
    weights = np.full_like(data, 1 / np.abs(data).max()) if errors is None else 1 / errors
    known: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def at(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = x.tobytes()
        if key not in known:
            known[key] = model(x)
        return known[key]

    def residuals(x: np.ndarray) -> np.ndarray:
        return weights * (at(x)[0] - data)

    def rates(x: np.ndarray) -> np.ndarray:
        return weights[:, None] * at(x)[1]

    found = least_squares(
        residuals,
        [unknown.start for unknown in unknowns],
        rates,
        bounds=([unknown.low for unknown in unknowns], [unknown.high for unknown in unknowns]),
        x_scale="jac",
        xtol=1e-6,
        ftol=1e-8,
        max_nfev=MOST_STEPS,
    )
    readings, jacobian = at(found.x)
    freedom = len(data) - len(found.x)
    misfit = 2 * found.cost / freedom
    scale = misfit if errors is None else 1.0
    by_weighted, silent = _pseudoinverse(weights[:, None] * jacobian)
    lost = np.isnan(by_weighted).any(axis=1)
    covariance = scale * np.nan_to_num(by_weighted) @ np.nan_to_num(by_weighted).T
    covariance[lost, lost] = np.inf
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(deviation, deviation)
    quantile = t.isf((1 - CONFIDENCE) / 2, freedom) if errors is None else norm.isf((1 - CONFIDENCE) / 2)
    exact = np.abs(readings - data).max() <= EXACT * np.abs(data).max()
    warnings = [] if found.success or exact else ["the fit has not converged: begin nearer by, or leave unknowns out"]
    warnings += [*_at_bounds(found.x, found.active_mask, unknowns), *_alike(correlation, silent, names)]
    residual = float(misfit if errors is not None else misfit / weights[0] ** 2)
    by_reading = by_weighted * weights
    return LeastSquares(
        found.x, deviation, quantile * deviation, correlation, by_reading, readings, residual, freedom, warnings
    )


def interval(solution: LeastSquares, of_model: np.ndarray) -> np.ndarray:
    """Half widths of 95 % intervals by the data and by the model.

    Parameters
    ----------
    solution : LeastSquares
        With half widths by the data.
    of_model : (unknowns,) ndarray
        Standard deviations by the model.

    Returns
    -------
    (unknowns,) ndarray
        In the units of the unknowns.
    """
    from scipy.stats import norm

    return np.hypot(solution.half_width, norm.isf((1 - CONFIDENCE) / 2) * of_model)


def misfit_warnings(residual: np.ndarray, errors: np.ndarray, of_model: np.ndarray, freedom: int) -> list[str]:
    """A warning if residuals are larger than errors explain, by a chi-square test with a false alarm in a hundred.

    Parameters
    ----------
    residual, errors : (N,) ndarray
        Data less model, and one standard deviation of the data.
    of_model : (N,) ndarray
        One standard deviation of the model; NaN if unknown.
    freedom : int
        Degrees of freedom.
    """
    from scipy.stats import chi2

    mean_square = np.square(residual / errors).sum() / freedom
    chance = chi2.sf(mean_square * freedom, freedom)
    if chance >= UNLIKELY:
        return []
    both = np.square(residual / np.hypot(errors, np.nan_to_num(of_model))).sum()
    reason = "the model or these errors are wrong, and intervals are too narrow"
    if chi2.sf(both, freedom) >= UNLIKELY:
        reason = "the model's own error, which intervals hold, is as large"
    return [
        f"residuals are {np.sqrt(mean_square):.2g} times as large as the errors of the data explain (probability "
        f"{chance:.1g}): {reason}"
    ]


def _pseudoinverse(jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(unknowns, N) pseudoinverse, NaN for unknowns with a component in an undetermined direction; and these directions
    (K, unknowns), in units that make all unknowns equally effective."""
    size = np.linalg.norm(jacobian, axis=0)
    unit = np.where(size > 0, size, 1.0)
    left, singular, directions = np.linalg.svd(jacobian / unit, full_matrices=False)
    seen = singular > RANK * singular.max(initial=0.0)
    inverse = (directions[seen].T / singular[seen]) @ left[:, seen].T / unit[:, None]
    silent = directions[~seen]
    inverse[(np.abs(silent) > 0.1).any(axis=0)] = np.nan
    return inverse, silent


def _at_bounds(values: np.ndarray, active: np.ndarray, unknowns: Sequence[Unknown]) -> list[str]:
    warnings = []
    for unknown, value, end in zip(unknowns, values, active, strict=True):
        if end:
            bound = unknown.high if end > 0 else unknown.low
            warnings.append(
                f"{unknown.name} = {value:.4g} is at the bound {bound:g} of its range; its interval is as if there "
                "were no bound"
            )
    return warnings


def _alike(correlation: np.ndarray, silent: np.ndarray, names: Sequence[str]) -> list[str]:
    warnings = []
    for direction in silent:
        parts = [name for name, part in zip(names, np.abs(direction), strict=True) if part > 0.1]
        what = f"cannot tell {' and '.join(parts)} apart" if len(parts) > 1 else f"say nothing of {parts[0]}"
        warnings.append(f"these data {what}")
    for one in range(len(names)):
        for other in range(one):
            if abs(correlation[one, other]) > ALIKE:
                warnings.append(
                    f"these data hardly tell {names[other]} and {names[one]} apart: their correlation is "
                    f"{correlation[one, other]:.4f}"
                )
    return warnings
