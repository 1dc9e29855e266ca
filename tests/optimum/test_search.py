"""What holds an optimum."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.optimum.search import Judged, balance, least_violation

NONE = (np.zeros(0), np.zeros((0, 2)))


def test_bounds_that_hold():
    def at(x):
        return Judged(np.array([x[0] - 3 * x[1]]), np.array([[1.0, -3.0]]), *NONE)

    x = np.array([0.0, 1.0])
    held = balance(x, at(x))
    np.testing.assert_allclose(held.bounds, [-1, 3], rtol=1e-4)
    assert held.left < 1e-6
    assert balance(np.array([0.5, 1.0]), at(x)).left == pytest.approx(1 / 3, rel=1e-3)


def test_constraints_in_conflict():
    """x at least 0.8 and at most 0.3; y at most 0.9 has nothing to do with it."""
    rates = np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]])
    judged = Judged(np.zeros(1), np.zeros((1, 2)), np.array([-0.3, 0.4, -0.2]), rates)
    step, violation, weights = least_violation(judged, np.full(2, -0.5), np.full(2, 0.5))
    assert step[0] == pytest.approx(0.05) and violation == pytest.approx(0.25)
    np.testing.assert_allclose(weights, [0.5, 0, 0.5], atol=1e-9)
