"""Prescribed displacements of a load, as constraint rows beside the matrix of a pad."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.elements.solvers import Factorisation

BATCH = 32
"""Number of right-hand sides that are solved together."""


@dataclass(frozen=True, eq=False)
class LoadConstraints:
    """Prescribed linear combinations of unknowns, enforced by Lagrange multipliers.

    ``rows @ unknowns + slack * multipliers`` is prescribed; ``rows.T @ multipliers`` are the constraint forces.

    Attributes
    ----------
    rows : (k, unknowns) csr_array
        Coefficients of each constraint.
    slack : (k,) ndarray
        Compliance of each constraint.
    """

    rows: sparse.csr_array
    slack: np.ndarray

    def flexibility(self, factor: Factorisation) -> np.ndarray:
        """Flexibility matrix (k, k) of k constraints: the change of each constrained combination of unknowns by a unit
        multiplier, from the factored matrix of the pad.
        """
        return responses(factor, self.rows, self.rows) + np.diag(self.slack)

    def negative(self, factor: Factorisation) -> int:
        """Number of negative eigenvalues of the pad's factored matrix that the constraints remove (E. V. Haynsworth,
        Linear Algebra Appl. 1, 1968).
        """
        return int(np.count_nonzero(np.linalg.eigvalsh(self.flexibility(factor)) < 0)) if len(self.slack) else 0


def responses(factor: Factorisation, rows: sparse.csr_array, forces: sparse.csr_array) -> np.ndarray:
    """Linear combinations of the unknowns under given forces.

    Parameters
    ----------
    factor : Factorisation
        Factor of the tangent of the pad.
    rows : (k, unknowns) csr_array
        Linear combinations of the unknowns.
    forces : (p, unknowns) csr_array
        Right-hand sides.

    Returns
    -------
    (k, p) ndarray
        Value of each combination under each force.
    """
    values = np.empty((rows.shape[0], forces.shape[0]))
    for first in range(0, forces.shape[0], BATCH):
        batch = slice(first, first + BATCH)
        values[:, batch] = rows @ factor.solve_many(forces[batch].toarray().T)
    return values
