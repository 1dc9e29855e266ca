"""Contact of a linear body at few nodes, with and without Coulomb friction, from the flexibility of the body at these
nodes.

Gaps are linear in the pressures: gap = matrix @ pressure + offset. At each node in contact or close to it, pressure and
gap are not negative, and one of both is 0.
"""

from __future__ import annotations

import numpy as np

PATIENCE = 3
"""Number of consecutive exchanges of all violated nodes without progress, after which nodes are exchanged one at a
time."""
MOST_EXCHANGES = 300
SLIP_WEIGHTS = (1.0, 10.0, 0.1)
"""Weights of the slip scale in the test for sliding, relative to the slip that unit forces at all nodes cause; tried in
turn until the iteration converges."""
MOST_ITERATIONS = 30
CONVERGED = 1e-9
"""Largest last change of pressures and tractions, relative to the largest pressure."""


def pressures(matrix: np.ndarray, offset: np.ndarray, active: np.ndarray) -> np.ndarray | None:
    """Contact pressures without friction, by solving a linear complementarity problem.

    It is solved by block principal pivoting, which terminates for positive definite matrices (J. J. Judice and F. M.
    Pires, Computers Oper. Res. 21, 1994).

    Parameters
    ----------
    matrix : (m, m) ndarray
        Gap at each node (rows) per pressure at each node (columns).
    offset : (m,) ndarray
        Gaps without pressures.
    active : (m,) ndarray of bool
        Initial guess of the nodes in contact.

    Returns
    -------
    (m,) ndarray or None
        Pressures; None if no solution was found.
    """
    active, fewest_violated, patience = active.copy(), len(offset) + 1, PATIENCE
    for _ in range(MOST_EXCHANGES):
        # Solve for the active nodes; a pressure that pulls, or a gap that is negative elsewhere, is a violation.
        solution = np.zeros(len(offset))
        try:
            solution[active] = np.linalg.solve(matrix[np.ix_(active, active)], -offset[active])
        except np.linalg.LinAlgError:
            return None
        violated = np.flatnonzero(np.where(active, solution, matrix @ solution + offset) < 0)
        if not len(violated):
            return solution

        # Exchange all violated nodes while their number falls; else the last one alone, which cannot cycle.
        if len(violated) < fewest_violated:
            fewest_violated, patience = len(violated), PATIENCE
        else:
            patience -= 1
        exchanged = violated if patience > 0 else violated[-1:]
        active[exchanged] = ~active[exchanged]
    return None


def tractions(matrix: np.ndarray, offset: np.ndarray, friction: float, guess: np.ndarray) -> np.ndarray | None:
    """Contact pressures and tractions with Coulomb friction.

    In y = matrix @ x + offset, x holds the pressures at k nodes and their tractions along two tangents, and y the gaps
    and the slip along these tangents. A traction is at most ``friction`` times the pressure. If it is less, there is no
    slip; otherwise the slip is opposite to it. The problem is solved by a semismooth Newton method (P. Alart and A.
    Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991).

    Parameters
    ----------
    matrix : (3 k, 3 k) ndarray
        Derivatives of the gaps, then of the slip (rows), with respect to the pressures, then the tractions (columns),
        at k nodes.
    offset : (3 k,) ndarray
        Gaps, then slip, without contact forces.
    friction : float
        Coefficient of friction.
    guess : (3 k,) ndarray
        Initial pressures, then tractions.

    Returns
    -------
    (3 k,) ndarray or None
        Pressures, then tractions along the first tangent, then along the second; None if no solution was found.
    """
    count = len(offset) // 3
    own_gap = np.abs(np.diag(matrix)[:count])  # may be negative if the pad alone, without its supports, is unstable
    total_slip = np.abs(matrix).sum(axis=1).reshape(3, count)[1:].max(axis=0)
    for weight in SLIP_WEIGHTS:
        scales = np.stack([own_gap, weight * total_slip])
        for start in (guess, np.zeros_like(guess)):
            solution = start
            for _ in range(MOST_ITERATIONS):
                residual, slope = _friction_residual(matrix, offset, friction, solution, scales)
                try:
                    change = np.linalg.solve(slope, residual)
                except np.linalg.LinAlgError:
                    break
                solution = solution - change
                if np.abs(change).max() <= CONVERGED * np.abs(solution[:count]).max(initial=0.0):
                    return solution
    return None


def _friction_residual(
    matrix: np.ndarray, offset: np.ndarray, friction: float, forces: np.ndarray, scales: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Residual (3 k,) of Coulomb's law for pressures and tractions, and its derivative (3 k, 3 k) with respect to them.

    ``scales`` (2, k) are compliances, by which gaps and slip are divided in the tests for contact and for sliding.
    """
    # Whether each node is open, sticks or slides follows from its pressure and traction, less the scaled gap and slip.
    count = len(offset) // 3
    gap, *slip = (matrix @ forces + offset).reshape(3, count)
    pressure, traction = forces[:count], forces[count:].reshape(2, count)
    touches = pressure - gap / scales[0] > 0
    trial = traction - np.array(slip) / scales[1]
    trial_size = np.maximum(np.hypot(*trial), np.finfo(float).tiny)
    limit = friction * np.maximum(pressure, 0.0)
    sticks = touches & (trial_size < friction * np.maximum(pressure - gap / scales[0], 0.0))

    # Forces on open nodes are 0. In contact the gap is 0; where the node sticks, the slip is 0 too.
    unit = np.eye(3 * count)
    residual, slope = forces.copy(), unit.copy()
    normal = np.flatnonzero(touches)
    residual[normal], slope[normal] = gap[normal], matrix[normal]
    for axis in range(2):
        stuck = (axis + 1) * count + np.flatnonzero(sticks)
        residual[stuck], slope[stuck] = slip[axis][sticks], matrix[stuck]

    # Where the node slides, the traction has the largest allowed magnitude and the direction of the trial traction.
    direction, sliding = trial / trial_size, np.flatnonzero(touches & ~sticks)
    ratio = (np.minimum(limit, trial_size) / trial_size)[sliding]
    along = [
        unit[(axis + 1) * count + sliding] - matrix[(axis + 1) * count + sliding] / scales[1][sliding, None]
        for axis in range(2)
    ]
    radial = direction[0][sliding, None] * along[0] + direction[1][sliding, None] * along[1]
    for axis in range(2):
        rows = (axis + 1) * count + sliding
        residual[rows] = traction[axis][sliding] - limit[sliding] * direction[axis][sliding]
        slope[rows] = unit[rows] - friction * direction[axis][sliding, None] * unit[sliding]
        slope[rows] -= ratio[:, None] * (along[axis] - direction[axis][sliding, None] * radial)
    return residual, slope
