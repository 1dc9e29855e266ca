"""Displacements that a load sets instead of forces, as rows of equations beside the matrix of a pad."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.elements.solvers import Factorisation

BATCH = 32
"""Right-hand sides that are solved for at once."""


@dataclass(frozen=True, eq=False)
class Held:
    """Sums of unknowns that are held: ``rows @ unknowns + slack * holding`` is given, ``rows.T @ holding`` acts.

    Attributes
    ----------
    rows : (k, unknowns) csr_array
    slack : (k,) ndarray
        By what each sum gives way to what holds it.
    """

    rows: sparse.csr_array
    slack: np.ndarray

    def flexibility(self, factor: Factorisation) -> np.ndarray:
        """(k, k) how the sums answer what holds them, with the factor of the pad's matrix."""
        return answers(factor, self.rows, self.rows) + np.diag(self.slack)

    def negative(self, factor: Factorisation) -> int:
        """How many negative eigenvalues of the factored matrix holding takes away (E. V. Haynsworth, 1968)."""
        return int(np.count_nonzero(np.linalg.eigvalsh(self.flexibility(factor)) < 0)) if len(self.slack) else 0


def answers(factor: Factorisation, rows: sparse.csr_array, pushed: sparse.csr_array) -> np.ndarray:
    """(k, p) what ``rows`` (k, unknowns) give for displacements under each of ``pushed`` (p, unknowns)."""
    found = np.empty((rows.shape[0], pushed.shape[0]))
    for first in range(0, pushed.shape[0], BATCH):
        batch = slice(first, first + BATCH)
        found[:, batch] = rows @ factor.solve_many(pushed[batch].toarray().T)
    return found
