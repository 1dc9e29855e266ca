"""Displacements against which an equilibrium is unstable."""

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.elements.solvers import make_solver
from mitsuba_taxel.mechanics.path.unstable_modes import unstable_modes

DISPLACEMENTS, PRESSURES, COMPRESSIBILITY = 40, 10, 0.1


def test_they_are_the_eigenvectors_of_the_tangent_of_displacements_alone():
    """Whose pressures follow, computed densely; one of them is far from zero, as that of a small fold is."""
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.standard_normal((DISPLACEMENTS, DISPLACEMENTS)))[0]
    stiffness = turn @ np.diag(np.concatenate([[-5000.0, -200.0, -50.0], np.arange(1, 38)])) @ turn.T
    volumes = rng.standard_normal((DISPLACEMENTS, PRESSURES))
    value, vector = np.linalg.eigh(stiffness + volumes @ volumes.T / COMPRESSIBILITY)
    count = int((value < 0).sum())
    assert count > 1
    mass = COMPRESSIBILITY * np.eye(PRESSURES)
    lower = sparse.csc_matrix(np.tril(np.block([[stiffness, volumes], [volumes.T, -mass]])))
    factor = make_solver().factor(lower)
    assert factor.negative_pivots is None or factor.negative_pivots == PRESSURES + count
    modes = unstable_modes(lower, factor, DISPLACEMENTS, count)[:DISPLACEMENTS]
    np.testing.assert_allclose(np.abs(modes.T @ vector[:, :count]).max(axis=0), 1, atol=1e-6)
    np.testing.assert_allclose(np.square(modes).sum(axis=0), 1, atol=1e-6)
    np.testing.assert_array_equal(modes, unstable_modes(lower, factor, DISPLACEMENTS, count)[:DISPLACEMENTS])
