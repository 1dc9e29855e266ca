"""Which of some places press: pressures and gaps that are not negative, and of which one is zero at each place."""

from __future__ import annotations

import numpy as np

PATIENCE = 3
"""How often in a row all places may be exchanged without fewer being wrong."""
MOST_EXCHANGES = 300


def pressures(matrix: np.ndarray, offset: np.ndarray, pressing: np.ndarray) -> np.ndarray | None:
    """(m,) x >= 0 with matrix @ x + offset >= 0 of which one is 0 at each place; None if it is not found.

    By block principal pivoting, which ends where the matrix is positive definite (J. J. Judice and F. M. Pires,
    Computers Oper. Res. 21, 1994).

    Parameters
    ----------
    pressing : (m,) ndarray
        Guess of where x is above 0.
    """
    pressing, fewest, patience = pressing.copy(), len(offset) + 1, PATIENCE
    for _ in range(MOST_EXCHANGES):
        found = np.zeros(len(offset))
        try:
            found[pressing] = np.linalg.solve(matrix[np.ix_(pressing, pressing)], -offset[pressing])
        except np.linalg.LinAlgError:
            return None
        wrong = np.flatnonzero(np.where(pressing, found, matrix @ found + offset) < 0)
        if not len(wrong):
            return found
        if len(wrong) < fewest:
            fewest, patience = len(wrong), PATIENCE
        else:
            patience -= 1
        exchanged = wrong if patience > 0 else wrong[-1:]
        pressing[exchanged] = ~pressing[exchanged]
    return None
