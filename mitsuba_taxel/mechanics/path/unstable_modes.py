"""The displacements against which an equilibrium is unstable."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from mitsuba_taxel.mechanics.elements.solvers import Factorisation, symmetric_product


def unstable_modes(lower: sparse.csc_matrix, factor: Factorisation, displacements: int, count: int) -> np.ndarray:
    """(unknowns, k) eigenvectors of a tangent with negative eigenvalues, of unit size over the displacements.

    By Lanczos' method on the inverse (R. B. Lehoucq, D. C. Sorensen and C. Yang, *ARPACK Users' Guide*, 1998), the same
    on each call: none if it does not converge.

    Parameters
    ----------
    lower : sparse.csc_matrix
        Lower triangle of the tangent, over displacements and pressures.
    displacements : int
        Number of displacements among the unknowns; they come first.
    count : int
        Number of negative eigenvalues apart from those of the pressures.
    """
    shape = lower.shape
    moved = sparse.diags_array((np.arange(shape[0]) < displacements).astype(float)).tocsc()
    tangent = LinearOperator(shape, lambda vector: symmetric_product(lower, vector.ravel()), dtype=float)
    inverse = LinearOperator(shape, lambda vector: factor.solve(np.array(vector, dtype=float).ravel()), dtype=float)
    start = np.random.default_rng(0).standard_normal(shape[0])
    try:
        value, mode = eigsh(tangent, count, moved, sigma=0, which="SA", v0=start, OPinv=inverse)
    except ArpackError:
        return np.zeros((shape[0], 0))
    return mode[:, value < 0]
