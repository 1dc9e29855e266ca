"""Contact forces on many patches: against Hertz, against another method, and the conditions of contact."""

from __future__ import annotations

import numpy as np
import pytest
from half_space import grid, half_space
from scipy.optimize import nnls

from mitsuba_taxel.surrogates import contact_pressures
from mitsuba_taxel.surrogates.contact_pressures import contact_forces

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(("radius", "depth"), [(10.0, 0.1), (4.0, 0.16), (25.0, 0.05)])
def test_a_ball_presses_as_hertz_says(radius, depth):
    side, contact = 0.1, np.sqrt(radius * depth)
    x, y = grid(27, side)
    forces = contact_forces(half_space(x, y, side), (depth - (x**2 + y**2) / (2 * radius))[None])[0]
    assert forces.sum() == pytest.approx(4 / 3 * radius**0.5 * depth**1.5, rel=0.01)
    rim = np.pi * contact * side  # half a patch along the circumference
    assert np.count_nonzero(forces) * side**2 == pytest.approx(np.pi * contact**2, abs=rim)
    middle = np.argmin(x**2 + y**2)
    assert forces[middle] / side**2 == pytest.approx(2 * contact / (np.pi * radius), rel=0.01)


def test_the_conditions_of_contact_hold_for_random_bodies_and_matrices():
    rng = np.random.default_rng(1)
    x, y = grid(7, 0.3)
    soft = rng.normal(size=(49, 60))
    for matrix in (half_space(x, y, 0.3), soft @ soft.T):
        depth = rng.uniform(-0.2, 0.3, (300, 1)) + 0.15 * rng.normal(size=(300, 49))
        forces = contact_forces(matrix, depth)
        gap, scale = forces @ matrix - depth, np.abs(depth).max()
        assert (forces >= 0).all() and not forces[depth <= 0].any()
        assert (gap[depth > 0] > -1e-10 * scale).all() and np.abs(gap[forces > 0]).max() < 1e-10 * scale
        for row in range(0, 300, 25):  # the same as non-negative least squares of L^T f = L^-1 d, with C = L L^T
            below = depth[row] > 0
            factor = np.linalg.cholesky(matrix[np.ix_(below, below)])
            expected, _ = nnls(factor.T, np.linalg.solve(factor, depth[row, below]))
            np.testing.assert_allclose(forces[row, below], expected, rtol=0, atol=1e-8 * expected.max(initial=1e-9))


def test_batches_of_any_size_give_the_same(monkeypatch):
    x, y = grid(6, 0.3)
    depth = np.random.default_rng(2).uniform(-0.5, 0.2, (40, 36))
    depth[7] = -1.0
    whole = contact_forces(half_space(x, y, 0.3), depth)
    assert not whole[7].any()
    monkeypatch.setattr(contact_pressures, "MOST_ENTRIES", 500)
    np.testing.assert_allclose(contact_forces(half_space(x, y, 0.3), depth), whole, rtol=0, atol=1e-13)


def test_rows_that_are_no_numbers_or_are_not_solved_are_nan(monkeypatch):
    x, y = grid(4, 0.3)
    matrix, depth = half_space(x, y, 0.3), np.random.default_rng(3).uniform(-0.1, 0.2, (5, 16))
    depth[1, 3], depth[4, 0] = np.nan, np.inf
    forces = contact_forces(matrix, depth)
    assert np.isnan(forces[[1, 4]]).all() and np.isfinite(forces[[0, 2, 3]]).all()
    monkeypatch.setattr(contact_pressures, "MOST_EXCHANGES", 1)
    depth[2], depth[3] = -1.0, 0.1 - 0.05 * x**2
    depth[3, 5] = 1.0  # a peak: the patches beside it lose contact
    once = contact_forces(matrix, depth)
    assert np.isnan(once[3]).any() and not once[2].any()
