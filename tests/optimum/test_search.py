"""What holds an optimum."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.optimum.search import Linearisation, least_violation, stationarity

NONE = (np.zeros(0), np.zeros((0, 2)))


def test_bounds_that_hold():
    def at(x):
        return Linearisation(np.array([x[0] - 3 * x[1]]), np.array([[1.0, -3.0]]), *NONE)

    x = np.array([0.0, 1.0])
    held = stationarity(x, at(x))
    np.testing.assert_allclose(held.bounds, [-1, 3], rtol=1e-4)
    assert held.unbalanced < 1e-6
    assert stationarity(np.array([0.5, 1.0]), at(x)).unbalanced == pytest.approx(1 / 3, rel=1e-3)


@pytest.mark.parametrize(("gap", "left"), [(0.004, 0.0), (0.006, 1.0)])
def test_a_bound_holds_what_is_close_to_it(gap, left):
    """The slope towards it would gain 0.4 % on the way."""
    near = Linearisation(np.ones(1), np.array([[1.0, 0.0]]), *NONE)
    held = stationarity(np.array([gap, 0.5]), near)
    assert held.unbalanced == pytest.approx(left, abs=1e-6) and held.bounds[0] == pytest.approx(left - 1, abs=1e-6)
    away = stationarity(np.array([gap, 0.5]), Linearisation(np.ones(1), np.array([[-1.0, 0.0]]), *NONE))
    assert away.unbalanced == pytest.approx(1) and not away.bounds.any()


@pytest.mark.parametrize("count", [2, 5, 20])
def test_the_scatter_of_what_is_left(count):
    """Bounded by x alone, a slope by y is left. In 84 % of all cases its length is below that plus the error."""
    random = np.random.default_rng(count)
    x, slope = np.array([0.0, 0.5, 0.5]), np.array([5.0, 0.3, 0.0])
    found = []
    for _ in range(500):
        rates = slope + 0.2 * random.normal(size=(count, 3))
        each = [Linearisation(np.ones(1), one[None], np.zeros(0), np.zeros((0, 3))) for one in rates]
        found.append(stationarity(x, each[0], each[1:]))
    covered = np.mean([held.unbalanced + held.error >= 0.3 for held in found])
    assert covered > 0.84 - 4 * np.sqrt(0.84 * 0.16 / 500)
    errors = [held.error for held in found]
    if count == 20:
        assert np.mean(errors) == pytest.approx(0.2 * np.sqrt(2 / 20), rel=0.05), "of y and z, not of x"


def test_what_scatters_along_constraints_is_held():
    """The limit x + y and two goals balance whatever gradients are; one goal is left to scatter along the limit."""
    rates = [np.array([[2 + k, 1 - k], [1.0, 2.0]]) for k in (0.0, 0.4)]
    limit = np.zeros(1), np.array([[1.0, 1.0]])
    both = [Linearisation(np.ones(2), goals, *limit) for goals in rates]
    held = stationarity(np.full(2, 0.5), both[0], both[1:])
    assert held.unbalanced < 1e-4 and held.error < 1e-4 and held.gradients == 2
    one = [Linearisation(np.ones(1), goals[:1], *limit) for goals in rates]
    held = stationarity(np.full(2, 0.5), one[0], one[1:])
    assert held.unbalanced == pytest.approx(0.7 * np.sqrt(2), rel=1e-3)
    assert held.error == pytest.approx(1.837 * 0.2 * np.sqrt(2), rel=1e-3)


def test_constraints_in_conflict():
    """x at least 0.8 and at most 0.3; y at most 0.9 has nothing to do with it."""
    rates = np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]])
    linearisation = Linearisation(np.zeros(1), np.zeros((1, 2)), np.array([-0.3, 0.4, -0.2]), rates)
    step, violation, weights = least_violation(linearisation, np.full(2, -0.5), np.full(2, 0.5))
    assert step[0] == pytest.approx(0.05) and violation == pytest.approx(0.25)
    np.testing.assert_allclose(weights, [0.5, 0, 0.5], atol=1e-9)
