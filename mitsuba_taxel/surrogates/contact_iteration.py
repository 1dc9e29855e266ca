"""Contact forces by an iteration with a constant matrix, for runtimes that cannot solve systems of varying size.

The problem is that of `contact_pressures`. The alternating direction method of multipliers (S. Boyd et al., Foundations
and Trends in Machine Learning 3, 2011, with over-relaxation as in their section 3.4.3) needs one product with a matrix
in each iteration, and converges linearly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.surrogates.contact_pressures import contact_forces
from mitsuba_taxel.surrogates.contact_readings import ContactModel
from mitsuba_taxel.surrogates.contact_states import touches

RELAXATION = 1.8
"""Over-relaxation, between 1 and 2."""
TOLERANCE = 1e-10
"""Residual at which the iteration ends, relative to the largest force of each pad."""
TESTS = 64
"""Number of balls and rods, at two depths each, with which the number of iterations is found."""
MOST_ITERATIONS = 2000
RESERVE = 1.5
"""Number of iterations that are allowed, relative to the largest one that was needed."""


class Iteration(NamedTuple):
    """Constants of the iteration that finds the contact forces on M patches.

    Attributes
    ----------
    operator : (M, M) ndarray
        Inverse of compliance + penalty, N/mm.
    penalty : float
        Penalty in mm/N.
    most : int
        Number of iterations that are allowed.
    difference : float
        Largest difference of the forces from those of `contact_forces` on the bodies of the test, relative to the
        largest force of each.
    """

    operator: np.ndarray
    penalty: float
    most: int
    difference: float


def iteration_of(model: ContactModel) -> Iteration:
    """Choose the constants of the iteration for a contact model, and test them on balls and rods.

    Parameters
    ----------
    model : ContactModel
        The model.

    Returns
    -------
    Iteration
        The constants.

    Raises
    ------
    ComputationError
        if the iteration does not converge, as where the compliance is nearly singular.
    """
    least, largest = np.linalg.eigvalsh(model.compliance)[[0, -1]]
    if least <= 0:
        raise ComputationError(
            "the compliance of the patches is singular: they are smaller than the elements, and a larger --spacing is "
            "needed."
        )
    penalty = float(np.sqrt(least * largest))
    operator = np.linalg.inv(model.compliance + penalty * np.eye(len(model.compliance)))
    maps = [body.below(model.points, depth) for body in touches(model, TESTS) for depth in body.depths]
    depth = np.array(maps)[:, model.covered]
    forces, needed = iterated_forces(operator, penalty, depth, MOST_ITERATIONS)
    expected = contact_forces(model.compliance, depth)
    scale = expected.max(axis=1)
    difference = float((np.abs(forces - expected).max(axis=1)[scale > 0] / scale[scale > 0]).max(initial=0.0))
    return Iteration(operator, penalty, int(np.ceil(RESERVE * needed)), difference)


def iterated_forces(operator: np.ndarray, penalty: float, depth: np.ndarray, most: int) -> tuple[np.ndarray, int]:
    """Contact forces on the patches of a pad, by a fixed number of iterations or until they converge.

    Parameters
    ----------
    operator : (M, M) ndarray
        Inverse of compliance + penalty, N/mm.
    penalty : float
        Penalty in mm/N.
    depth : (B, M) ndarray
        Depths in mm of B bodies at each patch; 0 or less where there is none.
    most : int
        Largest number of iterations.

    Returns
    -------
    forces : (B, M) ndarray
        Forces in N.
    iterations : int
        Number of iterations.

    Raises
    ------
    ComputationError
        if it does not converge.
    """
    within, depth = depth > 0, np.maximum(depth, 0.0)
    forces, dual = np.zeros_like(depth), np.zeros_like(depth)
    for iteration in range(1, most + 1):
        free = (depth + penalty * (forces - dual)) @ operator
        total = RELAXATION * free + (1 - RELAXATION) * forces + dual
        before, forces = forces, np.where(within, np.maximum(total, 0.0), 0.0)
        dual = total - forces
        residual = np.maximum(np.abs(free - forces), np.abs(forces - before)).max(axis=1)
        if (residual <= TOLERANCE * forces.max(axis=1)).all():
            return forces, iteration
    raise ComputationError(f"contact forces do not converge in {most} iterations: a larger spacing is needed.")
