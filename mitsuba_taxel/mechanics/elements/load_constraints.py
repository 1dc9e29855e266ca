"""Prescribed displacements of a load, as constraint rows beside the matrix of a pad."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.elements.solvers import Factorisation

BATCH = 32
"""Number of right-hand sides solved at once."""


@dataclass(frozen=True, eq=False)
class LoadConstraints:
    """Prescribed sums of unknowns: ``rows @ unknowns + slack * multipliers`` is given, and ``rows.T @ multipliers``
    acts.

    Attributes
    ----------
    rows : (k, unknowns) csr_array
    slack : (k,) ndarray
        Compliance of each constraint.
    """

    rows: sparse.csr_array
    slack: np.ndarray

    def flexibility(self, factor: Factorisation) -> np.ndarray:
        """(k, k) response of the sums to the constraint forces, from the factored matrix of the pad."""
        return responses(factor, self.rows, self.rows) + np.diag(self.slack)

    def negative(self, factor: Factorisation) -> int:
        """Number of negative eigenvalues of the factored matrix that the constraints remove (E. V. Haynsworth,
        1968)."""
        return int(np.count_nonzero(np.linalg.eigvalsh(self.flexibility(factor)) < 0)) if len(self.slack) else 0


def responses(factor: Factorisation, rows: sparse.csr_array, forces: sparse.csr_array) -> np.ndarray:
    """(k, p) values of ``rows`` (k, unknowns) for the displacements under each of the forces ``forces`` (p,
    unknowns)."""
    values = np.empty((rows.shape[0], forces.shape[0]))
    for first in range(0, forces.shape[0], BATCH):
        batch = slice(first, first + BATCH)
        values[:, batch] = rows @ factor.solve_many(forces[batch].toarray().T)
    return values
