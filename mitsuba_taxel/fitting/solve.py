"""Weighted least squares with bounds, confidence intervals, and detection of undetermined unknowns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.fitting.plan import Unknown

ALIKE = 0.98
"""Correlation above which two unknowns count as indistinguishable."""
RANK = 1e-7
"""Singular value, relative to the largest singular value, below which a direction is undetermined."""
CONFIDENCE = 0.95
UNLIKELY = 0.01
"""Probability of larger residuals below which the model or the errors count as wrong."""
MOST_STEPS = 25
EXACT = 1e-7
"""Residual, relative to the largest reading, below which a fit counts as converged: along undetermined directions,
steps may continue because of rounding."""


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Solution of a least-squares fit to N readings.

    Attributes
    ----------
    values, errors : (unknowns,) ndarray
        The unknowns, and their standard deviations due to the data; infinite if undetermined.
    half_width : (unknowns,) ndarray
        Half widths of the 95 % confidence intervals due to the data, by Student's distribution if errors come from the
        residuals.
    correlation : (unknowns, unknowns) ndarray
        Correlation of the errors due to the data.
    by_reading : (unknowns, N) ndarray
        Derivative of each unknown with respect to each reading; NaN for undetermined unknowns.
    model : (N,) ndarray
        Readings of the model at the solution.
    misfit : float
        Sum of squares of residuals relative to their errors, per degree of freedom: about 1 if the model and the errors
        are right. Without errors of the data, the sum of squares of the residuals per degree of freedom.
    degrees_of_freedom : int
        Number of readings less number of unknowns.
    warnings : list[str]
        Lines for the user.
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
    """Estimate the unknowns of a model from N readings by weighted least squares within bounds.

    Parameters
    ----------
    model : Callable
        Function of the unknowns that returns readings (N,) and their derivatives (N, unknowns).
    data : (N,) ndarray
        Measured readings.
    errors : (N,) ndarray, optional
        Standard deviations of the readings. Without them, all readings have the same weight, and the error is estimated
        from the residuals.
    unknowns : Sequence[Unknown]
        Initial values and bounds.

    Returns
    -------
    LeastSquares
        Estimates with their errors and correlation.
    """
    from scipy.optimize import least_squares
    from scipy.stats import norm, t

    # Least squares of the weighted residuals; readings and derivatives of a point are computed once.
    names = [unknown.name for unknown in unknowns]
    weights = np.full_like(data, 1 / np.abs(data).max()) if errors is None else 1 / errors
    evaluated: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def at(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = x.tobytes()
        if key not in evaluated:
            evaluated[key] = model(x)
        return evaluated[key]

    def residuals(x: np.ndarray) -> np.ndarray:
        return weights * (at(x)[0] - data)

    def rates(x: np.ndarray) -> np.ndarray:
        return weights[:, None] * at(x)[1]

    solution = least_squares(
        residuals,
        [unknown.start for unknown in unknowns],
        rates,
        bounds=([unknown.low for unknown in unknowns], [unknown.high for unknown in unknowns]),
        x_scale="jac",
        xtol=1e-6,
        ftol=1e-8,
        max_nfev=MOST_STEPS,
    )

    # Covariance of the unknowns, infinite for undetermined ones.
    readings, jacobian = at(solution.x)
    freedom = len(data) - len(solution.x)
    misfit = 2 * solution.cost / freedom
    scale = misfit if errors is None else 1.0
    by_weighted, undetermined_directions = _pseudoinverse(weights[:, None] * jacobian)
    undetermined = np.isnan(by_weighted).any(axis=1)
    covariance = scale * np.nan_to_num(by_weighted) @ np.nan_to_num(by_weighted).T
    covariance[undetermined, undetermined] = np.inf
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(deviation, deviation)

    # Confidence intervals, and warnings on convergence, bounds and undetermined unknowns.
    quantile = t.isf((1 - CONFIDENCE) / 2, freedom) if errors is None else norm.isf((1 - CONFIDENCE) / 2)
    exact = np.abs(readings - data).max() <= EXACT * np.abs(data).max()
    warnings = (
        []
        if solution.success or exact
        else ["the fit has not converged: choose starts closer to the solution, or fit fewer unknowns"]
    )
    warnings += [
        *_at_bounds(solution.x, solution.active_mask, unknowns),
        *_alike(correlation, undetermined_directions, names),
    ]
    residual = float(misfit if errors is not None else misfit / weights[0] ** 2)
    by_reading = by_weighted * weights
    return LeastSquares(
        values=solution.x,
        errors=deviation,
        half_width=quantile * deviation,
        correlation=correlation,
        by_reading=by_reading,
        model=readings,
        misfit=residual,
        degrees_of_freedom=freedom,
        warnings=warnings,
    )


def interval(solution: LeastSquares, of_model: np.ndarray) -> np.ndarray:
    """Half widths of the 95 % confidence intervals of the unknowns, due to the errors of data and model.

    Parameters
    ----------
    solution : LeastSquares
        Solution with half widths due to the data.
    of_model : (unknowns,) ndarray
        Standard deviations due to the model.

    Returns
    -------
    (unknowns,) ndarray
        Half widths in the units of the unknowns.
    """
    from scipy.stats import norm

    return np.hypot(solution.half_width, norm.isf((1 - CONFIDENCE) / 2) * of_model)


def misfit_warnings(residual: np.ndarray, errors: np.ndarray, of_model: np.ndarray, freedom: int) -> list[str]:
    """A warning if residuals exceed the errors, by a chi-square test with a false-alarm rate of 1 %.

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
    reason = "the model is wrong or these errors are too small, so the intervals are too narrow"
    if chi2.sf(both, freedom) >= UNLIKELY:
        reason = "the error of the model, which the intervals include, explains the residuals"
    return [
        f"residuals are {np.sqrt(mean_square):.2g} times as large as the errors of the data explain (probability "
        f"{chance:.1g}): {reason}"
    ]


def lack_of_fit_warnings(
    residual: np.ndarray, settings: Mapping[str, Sequence[str]], of_model: np.ndarray, freedom: int
) -> list[str]:
    """A warning if residuals exceed the scatter of repeated readings, by an F-test with a false-alarm rate of 1 %.

    Source: N. R. Draper, H. Smith, Applied Regression Analysis, 3rd edition, Wiley, 1998, section 2.1.

    Parameters
    ----------
    residual : (rows, taxels) ndarray
        Data less model; the error of the data is unknown.
    settings : Mapping[str, Sequence[str]]
        Values for each row. Rows with equal values are repetitions.
    of_model : (rows, taxels) ndarray
        One standard deviation of the model; NaN if unknown.
    freedom : int
        Degrees of freedom of all residuals.
    """
    from scipy.stats import f

    rows = [tuple(row) for row in zip(*settings.values(), strict=True)]
    numbers = {row: number for number, row in enumerate(dict.fromkeys(rows))}
    group = np.array([numbers[row] for row in rows])
    counts = np.bincount(group)[:, None]
    mean = np.stack([np.bincount(group, column) for column in residual.T], axis=1) / counts

    # Scatter within the groups, and distances of their means from the model.
    of_scatter = residual.size - mean.size
    of_means = freedom - of_scatter
    scatter = np.square(residual - mean[group]).sum() / max(of_scatter, 1)
    if of_means < 1 or not scatter > 0:
        return []
    distance = (counts * mean**2).sum() / of_means
    chance = f.sf(distance / scatter, of_means, of_scatter)
    if chance >= UNLIKELY:
        return []
    model = np.square(np.nan_to_num(of_model)).sum() / of_means
    reason = "the model is wrong, or errors are common to the readings of a setting"
    if f.sf(distance / (scatter + model), of_means, of_scatter) >= UNLIKELY:
        reason = "the error of the model, which the intervals include, explains the residuals"
    times = np.sqrt(np.square(residual).sum() / freedom / scatter)
    return [
        f"residuals are {times:.2g} times as large as the scatter of repeated readings (probability {chance:.1g}): "
        f"{reason}"
    ]


def _pseudoinverse(jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pseudoinverse (unknowns, N) of a Jacobian (N, unknowns), and its undetermined directions (K, unknowns).

    The pseudoinverse is NaN for unknowns with a component in such a direction. Directions refer to unknowns that are
    scaled so that all have the same effect.
    """
    size = np.linalg.norm(jacobian, axis=0)
    unit = np.where(size > 0, size, 1.0)
    left_vectors, singular, directions = np.linalg.svd(jacobian / unit, full_matrices=False)
    determined = singular > RANK * singular.max(initial=0.0)
    inverse = (directions[determined].T / singular[determined]) @ left_vectors[:, determined].T / unit[:, None]
    undetermined = directions[~determined]
    inverse[(np.abs(undetermined) > 0.1).any(axis=0)] = np.nan
    return inverse, undetermined


def _at_bounds(values: np.ndarray, active: np.ndarray, unknowns: Sequence[Unknown]) -> list[str]:
    """Warnings for unknowns at a bound. ``active`` is -1 for an unknown at its lower bound, 1 at its upper bound, and 0
    at neither."""
    warnings = []
    for unknown, value, end in zip(unknowns, values, active, strict=True):
        if end:
            bound = unknown.high if end > 0 else unknown.low
            warnings.append(
                f"{unknown.name} = {value:.4g} is at the bound {bound:g} of its range; its interval ignores the bound"
            )
    return warnings


def _alike(correlation: np.ndarray, undetermined: np.ndarray, names: Sequence[str]) -> list[str]:
    """Warnings for unknowns that the data cannot tell from each other: undetermined directions, and pairs with a
    correlation above `ALIKE`."""
    warnings = []
    for direction in undetermined:
        involved = [name for name, component in zip(names, np.abs(direction), strict=True) if component > 0.1]
        verb = "distinguish" if len(involved) > 1 else "determine"
        warnings.append(f"these data do not {verb} {' and '.join(involved)}")
    for row in range(len(names)):
        for column in range(row):
            if abs(correlation[row, column]) > ALIKE:
                warnings.append(
                    f"these data hardly distinguish {names[column]} and {names[row]}: their correlation is "
                    f"{correlation[row, column]:.4f}"
                )
    return warnings
