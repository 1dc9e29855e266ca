"""Descent to an optimum by sequential quadratic programming in a trust region, for functions that jump a little.

Readings of designs with different meshes differ by the errors of these. A line search takes such a jump for the end of
the descent, and curvature from the gradients of two points that nearly coincide is noise. Here a step counts as a
success if the loss falls as predicted up to that jump, and gradients are compared over steps that are large enough.
Where meshes are moved from design to design, the jump is small; where one is renewed, the last point is judged again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.optimum.failures import LEAST_GAP, off_failures
from mitsuba_taxel.optimum.search import TINY, Judged, balanced, least_violation

FIRST_STEP = 0.3
"""Largest first change of a variable, relative to its bounds' width."""
LEAST_STEP = 1e-5
"""Changes below this are no step."""
COMPARED = 10
"""Shortest step over which gradients are compared, relative to the jump of figures."""
JUMP = 1e-3
"""Relative error of a figure that changes with the mesh."""
JUMP_MOVED = 3e-5
"""The same where the mesh is moved."""
JUMP_BARE = 1e-6
"""The same of scenes without a pad, whose points are those of fixed seeds."""
TOLERANCE = 3e-4
"""A descent ends where a relative improvement by less is expected."""
TOLERANCE_BARE = 1e-6
"""The same of scenes without a pad."""
STEPS = 100


class Trial(NamedTuple):
    """Evaluation of a point of the unit cube beside the last one that was accepted.

    Attributes
    ----------
    there : Judged or None
        None if it fails.
    here : Judged or None
        The last point again, if it had to be judged anew to be compared with.
    jump : float
        Relative error of goals, absolute one of limits, in a comparison of both.
    """

    there: Judged | None
    here: Judged | None = None
    jump: float = JUMP


At = Callable[[np.ndarray, np.ndarray], Trial]
"""Evaluation at a point beside another one, which was accepted."""


@dataclass(frozen=True, eq=False)
class Step:
    """Step of V variables that is best in the quadratic model.

    Attributes
    ----------
    d : (V,) ndarray
    goal : float
        Expected decrease of the worst goal.
    violation : float
        Expected largest violation of a limit.
    goals : (N,) ndarray
        Weights of the goals; their sum is 1.
    limits : (M,) ndarray
        Multipliers of the limits.
    """

    d: np.ndarray
    goal: float
    violation: float
    goals: np.ndarray
    limits: np.ndarray


def descend(at: At, start: np.ndarray, tolerance: float = TOLERANCE) -> np.ndarray:
    """Minimise the largest of several goals within limits, from a valid start; returns the last point that was
    accepted.

    Each step minimises the largest of the linearised goals plus a common quadratic term within the linearised limits
    and a box around the last point (R. Fletcher, Practical Methods of Optimization, 1987, chapters 12 and 14). The
    quadratic term is that of the Lagrangian, by damped BFGS updates (M. J. D. Powell, 1978). Once points have failed,
    steps end before a plane between them and all others.

    Where no more is expected, the curvature may be one of far away, such as of a steep slope or a kink, along which
    steps have become too short to correct it. So the descent begins again from there, without it, and ends where
    nothing has been gained since it last did.

    Parameters
    ----------
    tolerance : float
        Relative expected improvement at which to end.
    """
    here = at(start, start).there
    assert here is not None
    x, radius, penalty, fresh, compared, last, gained = start, FIRST_STEP, 0.0, True, (start, here), JUMP, False
    readable: list[np.ndarray] = [start]
    failed: list[np.ndarray] = []
    curvature = _even_curvature(here)
    for _ in range(STEPS):
        step = best_step(x, off_failures(x, here, readable, failed), curvature, radius)
        size = max(abs(here.worst), TINY)
        better = here.violation - step.violation
        if np.abs(step.d).max() < LEAST_STEP or (step.goal < tolerance * size and better < tolerance):
            if not gained:
                break
            curvature, radius, compared, gained = _even_curvature(here), FIRST_STEP, (x, here), False
            continue
        penalty = max(penalty, 2 * float(step.limits[: len(here.limits)].sum()))
        if better > 0:
            penalty = max(penalty, -2 * step.goal / better)
        end = np.clip(x + step.d, 0.0, 1.0)
        there, anew, jump = at(end, x)
        here = here if anew is None else anew
        if anew is not None or jump != last:  # gradients on different meshes
            compared, last = (x, here), jump
        length = float(np.abs(step.d).max())
        if there is None:
            if np.linalg.norm(np.subtract([x, *failed], end), axis=1).min() <= LEAST_GAP:
                radius = 0.4 * length  # no plane keeps off
            failed.append(end)
            continue
        readable.append(end)
        if np.abs(end - compared[0]).max() > COMPARED * jump:
            change = _lagrangian_rate(there, step) - _lagrangian_rate(compared[1], step)
            curvature, fresh = _updated(curvature, end - compared[0], change, fresh), False
            compared = end, there
        expected = step.goal + penalty * better
        found = here.worst - there.worst + penalty * (here.violation - there.violation)
        slack = jump * (size + penalty)
        share = (found + slack) / (expected + slack)
        if share > 0.1:
            x, here, gained = end, there, gained or found > tolerance * size + slack
        if share < 0.3:
            radius = 0.4 * length
        elif share > 0.8 and length > 0.9 * radius:
            radius = min(2 * radius, 1.0)
    return x


def best_step(x: np.ndarray, here: Judged, curvature: np.ndarray, radius: float) -> Step:
    """The step within a box and the bounds of the unit cube."""
    from scipy.optimize import minimize

    count = len(x)
    low, high = np.maximum(-x, -radius), np.minimum(1 - x, radius)
    first, violation, _ = least_violation(here, low, high)
    above = np.column_stack([-here.goal_rates, np.ones(len(here.goals))])
    within = np.column_stack([here.limit_rates, np.zeros(len(here.limits))])
    rates, offset = np.vstack([above, within]), np.append(-here.goals, here.limits + violation + 1e-9)
    minimum: Any = minimize
    found = minimum(
        lambda z: 0.5 * z[:count] @ curvature @ z[:count] + z[count],
        np.append(first, float((here.goals + here.goal_rates @ first).max())),
        jac=lambda z: np.append(curvature @ z[:count], 1.0),
        bounds=[*zip(low, high, strict=True), (None, None)],
        constraints={"type": "ineq", "fun": lambda z: rates @ z + offset, "jac": lambda z: rates},
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 200},
    )
    d = np.clip(found.x[:count], low, high)
    goals, limits = _multipliers(here, curvature, d, low, high, violation)
    model = float((here.goals + here.goal_rates @ d).max() + 0.5 * d @ curvature @ d)
    return Step(d, here.worst - model, violation, goals, limits)


def _multipliers(
    here: Judged, curvature: np.ndarray, d: np.ndarray, low: np.ndarray, high: np.ndarray, violation: float
) -> tuple[np.ndarray, np.ndarray]:
    """Weights of goals and multipliers of limits that balance the model's gradient at its minimum."""
    goals, limits = here.goals + here.goal_rates @ d, here.limits + here.limit_rates @ d
    near = 1e-6 * max(float(np.abs(goals).max()), TINY)
    worst, held = goals >= goals.max() - near, limits <= 1e-6 - violation
    ends = np.concatenate([-np.eye(len(d))[d <= low + 1e-9], np.eye(len(d))[d >= high - 1e-9]])
    weights, multipliers, _, _ = balanced(here.goal_rates[worst], here.limit_rates[held], ends, curvature @ d)
    of_goals, of_limits = np.zeros(len(goals)), np.zeros(len(limits))
    of_goals[worst], of_limits[held] = weights, multipliers
    return of_goals, of_limits


def _even_curvature(here: Judged) -> np.ndarray:
    """That of which the best step is one across the bounds."""
    return max(float(np.linalg.norm(here.goal_rates, axis=1).max()), TINY) * np.eye(here.goal_rates.shape[1])


def _lagrangian_rate(at: Judged, step: Step) -> np.ndarray:
    return step.goals @ at.goal_rates - step.limits[: len(at.limits)] @ at.limit_rates


def _updated(curvature: np.ndarray, s: np.ndarray, y: np.ndarray, fresh: bool) -> np.ndarray:
    """Damped BFGS update by the change ``y`` of the gradient over the step ``s``; it stays positive definite."""
    if fresh and s @ y > 0:
        curvature = float(s @ y / (s @ s)) * np.eye(len(s))
    pushed = curvature @ s
    bend = float(s @ pushed)
    if s @ y < 0.2 * bend:
        share = 0.8 * bend / (bend - s @ y)
        y = share * y + (1 - share) * pushed
    return curvature - np.outer(pushed, pushed) / bend + np.outer(y, y) / float(s @ y)
