"""Descent to an optimum within bounds and constraints, and its Lagrange multipliers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

FIRST_STEP = 0.3
"""Largest first step of a descent, without curvature information, relative to the bounds' width."""
ACTIVE = 0.02
"""Margin, relative to the limit or to the bounds' width, below which a constraint counts as active."""
TOLERANCE = 1e-4
BALANCED = 0.05
"""Largest remaining slope of an optimum."""
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


At = Callable[[np.ndarray], "Judged | None"]
"""Evaluation at a point; None if it fails."""


def descend(at: At, start: np.ndarray, tolerance: float = TOLERANCE, iterations: int = 100) -> Any:
    """Sequential quadratic programming (scipy's SLSQP) from a valid start; returns scipy's result.

    Several goals are minimised through one more variable that bounds them all, which makes their maximum smooth. A
    point that fails counts as no better than the last valid one, so that the line search halves the step.
    """
    from scipy.optimize import minimize

    last = at(start)
    assert last is not None
    steepest = float(np.linalg.norm(last.goal_rates, axis=1).max(initial=0.0))
    scale = min(1.0, FIRST_STEP / steepest) if steepest else 1.0
    count, several = len(start), len(last.goals) > 1

    def judged(z: np.ndarray) -> Judged:
        nonlocal last
        found = at(np.clip(z[:count], 0.0, 1.0))
        last = last if found is None else found
        assert last is not None
        return last

    def constraints(z: np.ndarray) -> np.ndarray:
        found = judged(z)
        return np.concatenate([z[count] - scale * found.goals, found.limits]) if several else found.limits

    def constraint_rates(z: np.ndarray) -> np.ndarray:
        found = judged(z)
        if not several:
            return found.limit_rates
        above = np.column_stack([-scale * found.goal_rates, np.ones(len(found.goals))])
        return np.concatenate([above, np.column_stack([found.limit_rates, np.zeros(len(found.limits))])])

    def goal(z: np.ndarray) -> float:
        return float(z[count]) if several else scale * judged(z).worst

    def goal_rate(z: np.ndarray) -> np.ndarray:
        return np.eye(count + 1)[count] if several else scale * judged(z).goal_rates[0]

    free: list[tuple[float | None, float | None]] = [(None, None)] if several else []
    below: Any = {"type": "ineq", "fun": constraints, "jac": constraint_rates}
    minimum: Any = minimize
    return minimum(
        goal,
        np.append(start, scale * last.worst) if several else start,
        jac=goal_rate,
        bounds=[(0.0, 1.0)] * count + free,
        constraints=below if several or len(last.limits) else (),
        method="SLSQP",
        options={"ftol": scale * tolerance, "maxiter": iterations},
    )


@dataclass(frozen=True, eq=False)
class Balance:
    """Conditions of Karush, Kuhn and Tucker at a point.

    Attributes
    ----------
    left : float
        Unbalanced slope of the worst goal, over the width of the bounds and relative to that goal; 0 at an optimum.
    limits : (M,) ndarray
        Multipliers of the limits: decrease of the worst goal if a limit were lower by 1.
    bounds : (V,) ndarray
        Multipliers of the bounds, negative for lower ones.
    """

    left: float
    limits: np.ndarray
    bounds: np.ndarray


def balance(x: np.ndarray, found: Judged) -> Balance:
    """Multipliers of active limits and bounds at a point, by non-negative least squares."""
    from scipy.optimize import nnls

    worst = np.flatnonzero(found.goals >= found.worst - ACTIVE * abs(found.worst))
    held = np.flatnonzero(found.limits <= ACTIVE)
    low, high = np.flatnonzero(x <= 1e-3), np.flatnonzero(x >= 1 - 1e-3)
    unit = np.eye(len(x))
    size = max(float(np.linalg.norm(found.goal_rates[worst], axis=1).max()), TINY)
    columns = np.concatenate([found.goal_rates[worst] / size, -found.limit_rates[held], -unit[low], unit[high]])
    heavy = 1e3  # enforces that weights of the worst goals sum to 1
    weights = np.where(np.arange(len(columns)) < len(worst), heavy, 0.0)
    multipliers, _ = nnls(np.vstack([columns.T, weights]), np.append(np.zeros(len(x)), heavy))
    left = size / max(abs(found.worst), TINY) * float(np.linalg.norm(columns.T @ multipliers))
    _, of_limits, of_low, of_high = np.split(multipliers, np.cumsum([len(worst), len(held), len(low)]))
    limits, bounds = np.zeros(len(found.limits)), np.zeros(len(x))
    limits[held] = size * of_limits
    bounds[low] -= size * of_low
    bounds[high] += size * of_high
    return Balance(left, limits, bounds)


def in_conflict(x: np.ndarray, found: Judged) -> np.ndarray:
    """(M,) weights of limits that cannot be met together, to first order from a point: the multipliers of the least
    violation within the bounds."""
    from scipy.optimize import linprog

    count = len(x)
    cost = np.append(np.zeros(count), 1.0)
    rows = np.column_stack([-found.limit_rates, -np.ones(len(found.limits))])
    bounds: list[tuple[float, float | None]] = [*((-each, 1 - each) for each in x.tolist()), (0.0, None)]
    solved = linprog(cost, A_ub=rows, b_ub=found.limits, bounds=bounds)
    return -solved.ineqlin.marginals if solved.success else (found.limits < 0).astype(float)
