"""Goals and limits of a design with their gradients, its Lagrange multipliers, and constraints in conflict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

ACTIVE = 0.02
"""Margin, relative to the limit, below which a constraint counts as active."""
AT_BOUND = 5e-3
"""Distance from a bound, relative to the bounds' width, below which the bound counts as active.

Over this distance, readings of loaded cells vary by a thousandth from mesh to mesh, and a design at the bound would
gain at most this fraction of the slope."""
BALANCED = 0.05
"""Largest unbalanced slope of a local optimum, including its standard error."""
ONE_SIGMA = 0.8413
"""Probability that a normal error is below one standard deviation."""
TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Linearisation:
    """N goals and M limits at a point of the unit cube of V variables, with their derivatives.

    Attributes
    ----------
    goals : (N,) ndarray
        Values whose maximum is minimised.
    goal_rates : (N, V) ndarray
        Derivatives of the goals.
    limits : (M,) ndarray
        Margins of constraints, at least 0 where they are met.
    limit_rates : (M, V) ndarray
        Derivatives of the limits.
    """

    goals: np.ndarray
    goal_rates: np.ndarray
    limits: np.ndarray
    limit_rates: np.ndarray

    @property
    def worst(self) -> float:
        """The largest goal: the value that is minimised."""
        return float(self.goals.max())

    @property
    def violation(self) -> float:
        """Largest violation of a constraint; 0 if all are met."""
        return float(np.maximum(-self.limits, 0.0).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Stationarity:
    """How far a point is from the conditions of an optimum (Karush-Kuhn-Tucker): remaining slope and multipliers.

    Attributes
    ----------
    unbalanced : float
        Slope of the worst goal that remains within limits and bounds, as its relative change over the width of the
        bounds; 0 at an optimum.
    error : float
        Standard error of ``unbalanced``, from the scatter of the averaged gradients; NaN for one gradient.
    gradients : int
        Number of averaged gradients.
    limits : (M,) ndarray
        Lagrange multipliers of the limits: decrease of the worst goal if a limit were relaxed by 1.
    bounds : (V,) ndarray
        Multipliers of the bounds, negative for lower ones.
    """

    unbalanced: float
    error: float
    gradients: int
    limits: np.ndarray
    bounds: np.ndarray

    @property
    def is_local(self) -> bool:
        """Whether slope and error show that the point is a local optimum."""
        return self.unbalanced + self.error <= BALANCED


def stationarity(x: np.ndarray, linearisation: Linearisation, repeated: Sequence[Linearisation] = ()) -> Stationarity:
    """Lagrange multipliers of active limits and bounds at a point, and the slope of the goals that remains.

    Parameters
    ----------
    x : (V,) ndarray
        The point in the unit cube.
    linearisation : Linearisation
        Goals and limits at the point, from which active constraints are determined.
    repeated : Sequence[Linearisation]
        Goals and limits at the same point on other meshes. Gradients are averaged over all meshes.
    """
    # Active goals, limits and bounds, with the gradients of each evaluation (n, active, V).
    evaluations = [linearisation, *repeated]
    worst = np.flatnonzero(linearisation.goals >= linearisation.worst - ACTIVE * abs(linearisation.worst))
    active = np.flatnonzero(linearisation.limits <= ACTIVE)
    low, high = np.flatnonzero(x <= AT_BOUND), np.flatnonzero(x >= 1 - AT_BOUND)
    ends = np.concatenate([-np.eye(len(x))[low], np.eye(len(x))[high]])
    goal_rates = np.stack([evaluation.goal_rates[worst] for evaluation in evaluations])
    limit_rates = np.stack([evaluation.limit_rates[active] for evaluation in evaluations])

    # Multipliers for the mean gradients.
    means = goal_rates.mean(axis=0), limit_rates.mean(axis=0)
    weights, of_limits, of_ends, rest = balanced(*means, ends, np.zeros(len(x)))
    limits, bounds = np.zeros(len(linearisation.limits)), np.zeros(len(x))
    limits[active] = of_limits
    bounds[low] -= of_ends[: len(low)]
    bounds[high] += of_ends[len(low) :]

    # Scatter of the gradients of the Lagrangian, where the active constraints do not absorb it.
    chosen = means[0][weights > 0]
    normals = np.concatenate([chosen[1:] - chosen[:1], means[1][of_limits > 0], ends[of_ends > 0]])
    lagrangian = np.einsum("k,nkv->nv", weights, goal_rates) - np.einsum("k,nkv->nv", of_limits, limit_rates)
    scale = max(abs(linearisation.worst), TINY)
    error = _scatter(lagrangian, normals) / scale
    return Stationarity(float(np.linalg.norm(rest)) / scale, error, len(evaluations), limits, bounds)


def _scatter(gradients: np.ndarray, normals: np.ndarray) -> float:
    """Standard error of the length of the mean of N gradients (N, V), with Student's factor for small N.

    Scatter along ``normals`` (K, V), the normals of active constraints and differences of goals, is omitted: it changes
    multipliers only.
    """
    from scipy.stats import t

    count = len(gradients)
    if count < 2:
        return math.nan
    deviations = gradients - gradients.mean(axis=0)
    deviations -= deviations @ np.linalg.pinv(normals) @ normals
    return float(t.ppf(ONE_SIGMA, count - 1)) * math.sqrt(float(np.square(deviations).sum()) / (count - 1) / count)


def balanced(
    goal_rates: np.ndarray, limit_rates: np.ndarray, ends: np.ndarray, bent: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Weights of the goals and Lagrange multipliers that leave the least gradient at a point, for limits and bounds
    that are active.

    They are found by non-negative least squares.

    Parameters
    ----------
    goal_rates : (N, V) ndarray
        Gradients of the worst goals.
    limit_rates : (M, V) ndarray
        Gradients of active limits.
    ends : (E, V) ndarray
        Outward normals of active bounds.
    bent : (V,) ndarray
        Gradient of the quadratic term, which is added to the gradient of each goal.

    Returns
    -------
    goals : (N,) ndarray
        Weights, whose sum is 1.
    limits : (M,) ndarray
        Multipliers of the limits.
    bounds : (E,) ndarray
        Multipliers of the bounds.
    rest : (V,) ndarray
        Gradient that remains.
    """
    from scipy.optimize import nnls

    size = max(float(np.linalg.norm(goal_rates, axis=1).max()), TINY)
    columns = np.concatenate([(goal_rates + bent) / size, -limit_rates, ends])
    heavy = 1e3  # enforces that weights of the worst goals sum to 1
    weights = np.where(np.arange(len(columns)) < len(goal_rates), heavy, 0.0)
    solution, _ = nnls(np.vstack([columns.T, weights]), np.append(np.zeros(columns.shape[1]), heavy))
    goals, limits, bounds = np.split(solution, np.cumsum([len(goal_rates), len(limit_rates)]))
    return goals, size * limits, size * bounds, size * columns.T @ solution


def least_violation(
    linearisation: Linearisation, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, float, np.ndarray]:
    """The step with the least violation of the linearised limits, by linear programming.

    Parameters
    ----------
    linearisation : Linearisation
        Limits and their gradients at the point.
    low, high : (V,) ndarray
        Bounds of the step.

    Returns
    -------
    step : (V,) ndarray
        The step.
    violation : float
        The largest violation after the step.
    weights : (M,) ndarray
        Weights of the limits that prevent a smaller violation.
    """
    from scipy.optimize import linprog

    count = len(low)
    if not len(linearisation.limits) or linearisation.limits.min() >= 0:
        return np.zeros(count), 0.0, np.zeros(len(linearisation.limits))
    cost = np.append(np.zeros(count), 1.0)
    rows = np.column_stack([-linearisation.limit_rates, -np.ones(len(linearisation.limits))])
    bounds: list[tuple[float, float | None]] = [*zip(low.tolist(), high.tolist(), strict=True), (0.0, None)]
    solved = linprog(cost, A_ub=rows, b_ub=linearisation.limits, bounds=bounds)
    if not solved.success or solved.x is None:
        return np.zeros(count), linearisation.violation, (linearisation.limits < 0).astype(float)
    return solved.x[:count], float(solved.x[count]), -solved.ineqlin.marginals
