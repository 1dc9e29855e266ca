"""Pressures and tractions of a linear body with Coulomb friction."""

from __future__ import annotations

import numpy as np

EASES = (1.0, 10.0, 0.1)
"""Weights of slip relative to traction in the test for sliding, relative to the slip by all tractions."""
MOST_ITERATIONS = 30
SETTLED = 1e-9
"""Tolerance of the last change of tractions, relative to the largest pressure."""


def tractions(matrix: np.ndarray, offset: np.ndarray, friction: float, guess: np.ndarray) -> np.ndarray | None:
    """(3 k,) pressures and tractions along two tangents at k places; None if not found.

    With y = matrix @ x + offset, pressures x and gaps y are non-negative, and one of them is 0 at each place; tractions
    are at most ``friction`` times the pressure, and slip y is 0 where they are less, else opposite to them. By a
    semismooth Newton method (P. Alart and A. Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991).

    Parameters
    ----------
    guess : (3 k,) ndarray
        Initial values.
    """
    count = len(offset) // 3
    own = np.abs(np.diag(matrix)[:count])  # may be below 0 where the pad alone, without what holds it, is unstable
    whole = np.abs(matrix).sum(axis=1).reshape(3, count)[1:].max(axis=0)
    starts = (guess, np.zeros_like(guess))
    tries = ((start, np.stack([own, ease * whole])) for ease in EASES for start in starts)
    return next((found for one in tries if (found := _tried(matrix, offset, friction, *one)) is not None), None)


def _tried(
    matrix: np.ndarray, offset: np.ndarray, friction: float, found: np.ndarray, ease: np.ndarray
) -> np.ndarray | None:
    count = len(offset) // 3
    for _ in range(MOST_ITERATIONS):
        residual, slope = _residual(matrix, offset, friction, found, ease)
        try:
            change = np.linalg.solve(slope, residual)
        except np.linalg.LinAlgError:
            return None
        found = found - change
        if np.abs(change).max() <= SETTLED * np.abs(found[:count]).max(initial=0.0):
            return found
    return None


def _residual(
    matrix: np.ndarray, offset: np.ndarray, friction: float, found: np.ndarray, ease: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    count = len(offset) // 3
    answer = (matrix @ found + offset).reshape(3, count)
    pressure, traction = found[:count], found[count:].reshape(2, count)
    pressing = pressure - answer[0] / ease[0] > 0
    tried = traction - answer[1:] / ease[1]
    size = np.maximum(np.hypot(*tried), np.finfo(float).tiny)
    most = friction * np.maximum(pressure, 0.0)
    sticks = pressing & (size < friction * np.maximum(pressure - answer[0] / ease[0], 0.0))
    slides = pressing & ~sticks
    unit = np.eye(3 * count)
    residual, slope = found.copy(), unit.copy()
    normal = np.flatnonzero(pressing)
    residual[normal], slope[normal] = answer[0][normal], matrix[normal]
    for k in range(2):
        stuck = (k + 1) * count + np.flatnonzero(sticks)
        residual[stuck], slope[stuck] = answer[k + 1][sticks], matrix[stuck]
    way, at = tried / size, np.flatnonzero(slides)
    share = (np.minimum(most, size) / size)[at]
    along = [unit[(k + 1) * count + at] - matrix[(k + 1) * count + at] / ease[1][at, None] for k in range(2)]
    radial = way[0][at, None] * along[0] + way[1][at, None] * along[1]
    for k in range(2):
        rows = (k + 1) * count + at
        residual[rows] = traction[k][at] - most[at] * way[k][at]
        slope[rows] = unit[rows] - friction * way[k][at, None] * unit[at]
        slope[rows] -= share[:, None] * (along[k] - way[k][at, None] * radial)
    return residual, slope
