"""Descent to an optimum by sequential quadratic programming in a trust region, for functions with small jumps.

Readings of designs with different meshes differ by the errors of the meshes. At such a jump, a line search would stop,
and a curvature from the gradients of two close points would be noise. Here a step is accepted if the loss decreases as
predicted within the size of the jump, and gradients are compared over sufficiently long steps. If the mesh of a design
is moved to the next design, the jump is small; if the next design is meshed anew, the last point is evaluated again on
the new mesh.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.optimum.failures import LEAST_GAP, off_failures
from mitsuba_taxel.optimum.search import TINY, Linearisation, balanced, least_violation

FIRST_STEP = 0.3
"""Largest first change of a variable, relative to its bounds' width."""
LEAST_STEP = 1e-5
"""Steps whose largest change of a variable is below this count as no step."""
COMPARED = 10
"""Shortest step over which gradients are compared, relative to the jump of figures between meshes."""
JUMP = 1e-3
"""Relative error of figures compared on different meshes."""
JUMP_MOVED = 3e-5
"""Relative error of figures compared on a mesh and the same mesh moved."""
JUMP_BARE = 1e-6
"""Relative error of figures compared in scenes without a pad, whose random points have fixed seeds."""
TOLERANCE = 3e-4
"""Expected relative improvement below which a descent ends."""
TOLERANCE_BARE = 1e-6
"""Expected relative improvement below which a descent ends in scenes without a pad."""
STEPS = 100
"""Largest number of steps of a descent."""


class Trial(NamedTuple):
    """Result of an evaluated point of the unit cube of the variables, for the comparison with the last accepted point.

    Attributes
    ----------
    there : Linearisation or None
        Goals and limits at the point; None if its evaluation fails.
    here : Linearisation or None
        Goals and limits of the last accepted point, if it was evaluated again on the mesh of this point.
    jump : float
        Error of a comparison of the two points: relative for goals, absolute for limits.
    """

    there: Linearisation | None
    here: Linearisation | None = None
    jump: float = JUMP


At = Callable[[np.ndarray, np.ndarray], Trial]
"""Evaluation at a point (first argument) for comparison with the last accepted point (second argument)."""


@dataclass(frozen=True, eq=False)
class Step:
    """Best step in the quadratic model of the objective, for V variables, N goals and M limits.

    Attributes
    ----------
    d : (V,) ndarray
        Change of the variables.
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
    """Minimise the largest of several goals within limits, by sequential quadratic programming in a trust region.

    Each step minimises the largest of the linearised goals plus a common quadratic term, within the linearised limits
    and a box around the last point (R. Fletcher, Practical Methods of Optimization, 1987, chapters 12 and 14). The
    quadratic term is that of the Lagrangian, by damped BFGS updates (M. J. D. Powell, 1978). Once the evaluation of
    points has failed, steps end before a plane that separates the failed points from all others.

    If the model predicts no improvement, its curvature may be wrong: it may stem from a distant steep slope or kink,
    and steps may have become too short to correct it. The descent therefore restarts from the last point with a new
    curvature. It ends if it has gained nothing since the last restart.

    Parameters
    ----------
    at : At
        Function that evaluates a point (first argument) for comparison with the last accepted point (second argument),
        and returns a `Trial`. It must not fail at the start.
    start : (V,) ndarray
        First point in the unit cube.
    tolerance : float
        The descent ends if the predicted relative improvement is below this number.

    Returns
    -------
    (V,) ndarray
        The last accepted point.
    """
    here = at(start, start).there
    assert here is not None
    x, radius, penalty = start, FIRST_STEP, 0.0
    reference, last_jump = (start, here), JUMP  # the point with which gradients are compared next
    is_initial, has_gained = True, False  # of the curvature; anything gained since the last restart
    readable: list[np.ndarray] = [start]
    failed: list[np.ndarray] = []
    curvature = _even_curvature(here)
    for _ in range(STEPS):
        # The best step of the model. If it gains nothing, the descent restarts or ends.
        step = best_step(x, off_failures(x, here, readable, failed), curvature, radius)
        size = max(abs(here.worst), TINY)
        violation_decrease = here.violation - step.violation
        if np.abs(step.d).max() < LEAST_STEP or (step.goal < tolerance * size and violation_decrease < tolerance):
            if not has_gained:
                break
            curvature, radius, reference, has_gained = _even_curvature(here), FIRST_STEP, (x, here), False
            continue

        # A penalty on violations that makes the step a descent of the loss, the goal plus the penalised violation.
        penalty = max(penalty, 2 * float(step.limits[: len(here.limits)].sum()))
        if violation_decrease > 0:
            penalty = max(penalty, -2 * step.goal / violation_decrease)

        # Evaluation at the end of the step, and again at the last point if the mesh had to be renewed.
        end = np.clip(x + step.d, 0.0, 1.0)
        there, here_again, jump = at(end, x)
        here = here if here_again is None else here_again
        if here_again is not None or jump != last_jump:  # gradients of different meshes are not compared
            reference, last_jump = (x, here), jump
        length = float(np.abs(step.d).max())
        if there is None:
            if np.linalg.norm(np.subtract([x, *failed], end), axis=1).min() <= LEAST_GAP:
                radius = 0.4 * length  # a separating plane would be too close to both points
            failed.append(end)
            continue

        # Curvature from the change of the Lagrangian's gradient, over a step that is long enough.
        readable.append(end)
        if np.abs(end - reference[0]).max() > COMPARED * jump:
            change = _lagrangian_rate(there, step) - _lagrangian_rate(reference[1], step)
            curvature, is_initial = _updated(curvature, end - reference[0], change, is_initial), False
            reference = end, there

        # The step is accepted, and the box resized, by the ratio of actual and expected decrease of the loss.
        expected = step.goal + penalty * violation_decrease
        decrease = here.worst - there.worst + penalty * (here.violation - there.violation)
        slack = jump * (size + penalty)
        ratio = (decrease + slack) / (expected + slack)
        if ratio > 0.1:
            x, here, has_gained = end, there, has_gained or decrease > tolerance * size + slack
        if ratio < 0.3:
            radius = 0.4 * length
        elif ratio > 0.8 and length > 0.9 * radius:
            radius = min(2 * radius, 1.0)
    return x


def best_step(x: np.ndarray, here: Linearisation, curvature: np.ndarray, radius: float) -> Step:
    """The step that minimises the quadratic model within a box and the bounds of the unit cube.

    Parameters
    ----------
    x : (V,) ndarray
        Current point.
    here : Linearisation
        Goals and limits at that point.
    curvature : (V, V) ndarray
        Quadratic term of all goals.
    radius : float
        Largest change of a variable.

    Returns
    -------
    Step
        The step, its predicted improvement, and its multipliers.
    """
    from scipy.optimize import minimize

    count = len(x)
    low, high = np.maximum(-x, -radius), np.minimum(1 - x, radius)
    first, violation, _ = least_violation(here, low, high)

    # Minimise the quadratic term plus z, which is above all linearised goals, within the linearised limits.
    above = np.column_stack([-here.goal_rates, np.ones(len(here.goals))])
    within = np.column_stack([here.limit_rates, np.zeros(len(here.limits))])
    rates, offset = np.vstack([above, within]), np.append(-here.goals, here.limits + violation + 1e-9)
    minimise: Any = minimize
    with warnings.catch_warnings():
        # SciPy before 1.16 warns if it corrects a rounding error of its steps. Python 3.10 has no newer SciPy.
        warnings.filterwarnings("ignore", "Values in x were outside bounds", RuntimeWarning)
        solution = minimise(
            lambda z: 0.5 * z[:count] @ curvature @ z[:count] + z[count],
            np.append(first, float((here.goals + here.goal_rates @ first).max())),
            jac=lambda z: np.append(curvature @ z[:count], 1.0),
            bounds=[*zip(low, high, strict=True), (None, None)],
            constraints={"type": "ineq", "fun": lambda z: rates @ z + offset, "jac": lambda z: rates},
            method="SLSQP",
            options={"ftol": 1e-12, "maxiter": 200},
        )
    d = np.clip(solution.x[:count], low, high)
    goals, limits = _multipliers(here, curvature, d, low, high, violation)
    model = float((here.goals + here.goal_rates @ d).max() + 0.5 * d @ curvature @ d)
    return Step(d, here.worst - model, violation, goals, limits)


def _multipliers(
    here: Linearisation, curvature: np.ndarray, d: np.ndarray, low: np.ndarray, high: np.ndarray, violation: float
) -> tuple[np.ndarray, np.ndarray]:
    """Weights of goals and multipliers of limits that balance the model's gradient at its minimum."""
    goals, limits = here.goals + here.goal_rates @ d, here.limits + here.limit_rates @ d
    tolerance = 1e-6 * max(float(np.abs(goals).max()), TINY)
    worst, active = goals >= goals.max() - tolerance, limits <= 1e-6 - violation
    ends = np.concatenate([-np.eye(len(d))[d <= low + 1e-9], np.eye(len(d))[d >= high - 1e-9]])
    weights, multipliers, _, _ = balanced(here.goal_rates[worst], here.limit_rates[active], ends, curvature @ d)
    of_goals, of_limits = np.zeros(len(goals)), np.zeros(len(limits))
    of_goals[worst], of_limits[active] = weights, multipliers
    return of_goals, of_limits


def _even_curvature(here: Linearisation) -> np.ndarray:
    """Initial curvature (V, V), equal in all directions. It is scaled such that the best step is as long as the range
    between the bounds.
    """
    return max(float(np.linalg.norm(here.goal_rates, axis=1).max()), TINY) * np.eye(here.goal_rates.shape[1])


def _lagrangian_rate(at: Linearisation, step: Step) -> np.ndarray:
    """Gradient (V,) of the Lagrangian function at a point, with the multipliers of a step."""
    return step.goals @ at.goal_rates - step.limits[: len(at.limits)] @ at.limit_rates


def _updated(curvature: np.ndarray, s: np.ndarray, y: np.ndarray, is_initial: bool) -> np.ndarray:
    """Damped BFGS update by the change ``y`` (V,) of the gradient over the step ``s`` (V,).

    The curvature stays positive definite. An initial curvature is first scaled to the curvature along the step.
    """
    if is_initial and s @ y > 0:
        curvature = float(s @ y / (s @ s)) * np.eye(len(s))
    pushed = curvature @ s
    curving = float(s @ pushed)
    if s @ y < 0.2 * curving:
        weight = 0.8 * curving / (curving - s @ y)
        y = weight * y + (1 - weight) * pushed
    return curvature - np.outer(pushed, pushed) / curving + np.outer(y, y) / float(s @ y)
