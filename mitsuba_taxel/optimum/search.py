"""Judged designs, and what holds them: Lagrange multipliers of constraints and bounds, and constraints in conflict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

ACTIVE = 0.02
"""Margin, relative to the limit, below which a constraint counts as active."""
AT_BOUND = 5e-3
"""Distance from a bound, relative to the bounds' width, below which it counts as active: readings of loaded cells
ripple by a thousandth over as much, and a slope towards the bound gains at most this share of itself."""
BALANCED = 0.05
"""Largest remaining slope of an optimum, with its error."""
ONE_SIGMA = 0.8413
"""Probability that a normal error is below one standard deviation."""
TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Judged:
    """A point of the unit cube of V variables.

    Attributes
    ----------
    goals : (N,) ndarray
        Their maximum is minimised.
    goal_rates : (N, V) ndarray
    limits : (M,) ndarray
        At least 0 if constraints are met.
    limit_rates : (M, V) ndarray
    """

    goals: np.ndarray
    goal_rates: np.ndarray
    limits: np.ndarray
    limit_rates: np.ndarray

    @property
    def worst(self) -> float:
        """The largest goal."""
        return float(self.goals.max())

    @property
    def violation(self) -> float:
        """Largest violation of a constraint; 0 if all are met."""
        return float(np.maximum(-self.limits, 0.0).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Stationarity:
    """Conditions of Karush, Kuhn and Tucker at a point.

    Attributes
    ----------
    left : float
        Unbalanced slope of the worst goal, over the width of the bounds and relative to that goal; 0 at an optimum.
    error : float
        Of ``left``, from the scatter of the gradients whose mean it is; NaN of one gradient.
    gradients : int
        Their number.
    limits : (M,) ndarray
        Multipliers of the limits: decrease of the worst goal if a limit were lower by 1.
    bounds : (V,) ndarray
        Multipliers of the bounds, negative for lower ones.
    """

    left: float
    error: float
    gradients: int
    limits: np.ndarray
    bounds: np.ndarray

    @property
    def is_local(self) -> bool:
        """Whether the point is a local optimum as far as its slope is known."""
        return self.left + self.error <= BALANCED


def stationarity(x: np.ndarray, found: Judged, others: Sequence[Judged] = ()) -> Stationarity:
    """Multipliers of active limits and bounds at a point.

    Gradients are the mean of the point's own and of ``others``, of the same point on other meshes.
    """
    every = [found, *others]
    worst = np.flatnonzero(found.goals >= found.worst - ACTIVE * abs(found.worst))
    held = np.flatnonzero(found.limits <= ACTIVE)
    low, high = np.flatnonzero(x <= AT_BOUND), np.flatnonzero(x >= 1 - AT_BOUND)
    ends = np.concatenate([-np.eye(len(x))[low], np.eye(len(x))[high]])
    goal_rates = np.stack([each.goal_rates[worst] for each in every])
    limit_rates = np.stack([each.limit_rates[held] for each in every])
    means = goal_rates.mean(axis=0), limit_rates.mean(axis=0)
    weights, of_limits, of_ends, rest = balanced(*means, ends, np.zeros(len(x)))
    limits, bounds = np.zeros(len(found.limits)), np.zeros(len(x))
    limits[held] = of_limits
    bounds[low] -= of_ends[: len(low)]
    bounds[high] += of_ends[len(low) :]
    chosen = means[0][weights > 0]
    normals = np.concatenate([chosen[1:] - chosen[:1], means[1][of_limits > 0], ends[of_ends > 0]])
    lagrangian = np.einsum("k,nkv->nv", weights, goal_rates) - np.einsum("k,nkv->nv", of_limits, limit_rates)
    scale = max(abs(found.worst), TINY)
    error = _scatter(lagrangian, normals) / scale
    return Stationarity(float(np.linalg.norm(rest)) / scale, error, len(every), limits, bounds)


def _scatter(gradients: np.ndarray, normals: np.ndarray) -> float:
    """Standard error of the length of the mean of N gradients (N, V), of few with Student's factor.

    Along ``normals``, of active constraints and between goals, scatter changes the multipliers alone.
    """
    from scipy.stats import t

    count = len(gradients)
    if count < 2:
        return math.nan
    apart = gradients - gradients.mean(axis=0)
    apart -= apart @ np.linalg.pinv(normals) @ normals
    return float(t.ppf(ONE_SIGMA, count - 1)) * math.sqrt(float(np.square(apart).sum()) / (count - 1) / count)


def balanced(
    goal_rates: np.ndarray, limit_rates: np.ndarray, ends: np.ndarray, bent: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Weights of goals, with a sum of 1, and multipliers of limits and of bounds, by non-negative least squares.

    Parameters
    ----------
    goal_rates : (N, V) ndarray
        Of the worst goals.
    limit_rates : (M, V) ndarray
        Of active limits.
    ends : (E, V) ndarray
        Outward normals of active bounds.
    bent : (V,) ndarray
        Added to the gradient.

    Returns
    -------
    They, and the (V,) gradient that they leave.
    """
    from scipy.optimize import nnls

    size = max(float(np.linalg.norm(goal_rates, axis=1).max()), TINY)
    columns = np.concatenate([(goal_rates + bent) / size, -limit_rates, ends])
    heavy = 1e3  # enforces that weights of the worst goals sum to 1
    weights = np.where(np.arange(len(columns)) < len(goal_rates), heavy, 0.0)
    found, _ = nnls(np.vstack([columns.T, weights]), np.append(np.zeros(columns.shape[1]), heavy))
    goals, limits, bounds = np.split(found, np.cumsum([len(goal_rates), len(limit_rates)]))
    return goals, size * limits, size * bounds, size * columns.T @ found


def least_violation(found: Judged, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """The (V,) step within ``low`` and ``high`` with the least violation of the linearised limits, that violation, and
    the (M,) weights of the limits that cause it."""
    from scipy.optimize import linprog

    count = len(low)
    if not len(found.limits) or found.limits.min() >= 0:
        return np.zeros(count), 0.0, np.zeros(len(found.limits))
    cost = np.append(np.zeros(count), 1.0)
    rows = np.column_stack([-found.limit_rates, -np.ones(len(found.limits))])
    bounds: list[tuple[float, float | None]] = [*zip(low.tolist(), high.tolist(), strict=True), (0.0, None)]
    solved = linprog(cost, A_ub=rows, b_ub=found.limits, bounds=bounds)
    if not solved.success or solved.x is None:
        return np.zeros(count), found.violation, (found.limits < 0).astype(float)
    return solved.x[:count], float(solved.x[count]), -solved.ineqlin.marginals
