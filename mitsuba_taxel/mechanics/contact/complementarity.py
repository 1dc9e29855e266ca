"""Linear complementarity of contact: pressures and gaps that are non-negative, one of them zero at each node."""

from __future__ import annotations

import numpy as np

PATIENCE = 3
"""Number of consecutive full exchanges without progress before single ones."""
MOST_EXCHANGES = 300


def pressures(matrix: np.ndarray, offset: np.ndarray, pressing: np.ndarray) -> np.ndarray | None:
    """(m,) x >= 0 with matrix @ x + offset >= 0, one of them 0 at each place; None if not found.

    By block principal pivoting, which terminates for positive definite matrices (J. J. Judice and F. M. Pires,
    Computers Oper. Res. 21, 1994).

    Parameters
    ----------
    pressing : (m,) ndarray
        Initial guess of where x is positive.
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
