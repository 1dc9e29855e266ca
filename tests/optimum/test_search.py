"""Descents to optima that are known, and what holds them."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.optimum.search import Judged, balance, descend, in_conflict

NONE = (np.zeros(0), np.zeros((0, 2)))


def lowest(at, start):
    """Where the descent saw the least of what is allowed, and how many points it took."""
    seen = {}

    def noted(x):
        seen[tuple(x)] = at(x)
        return seen[tuple(x)]

    descend(noted, np.array(start), tolerance=1e-8)
    allowed = {x: found for x, found in seen.items() if found is not None and found.violation < 1e-6}
    return np.array(min(allowed, key=lambda x: allowed[x].worst)), len(seen)


def rosenbrock(cube):
    """On [-2, 2] squared, within the unit circle: least at (0.7864, 0.6177)."""
    x, y = 4 * cube - 2
    value = 100 * (y - x**2) ** 2 + (1 - x) ** 2
    rate = 4 * np.array([-400 * x * (y - x**2) - 2 * (1 - x), 200 * (y - x**2)])
    return Judged(np.array([value]), rate[None], np.array([1 - x**2 - y**2]), -8 * np.array([[x, y]]))


def test_rosenbrock_in_a_circle():
    x, points = lowest(rosenbrock, (0.5, 0.5))
    np.testing.assert_allclose(4 * x - 2, [0.78642, 0.61770], atol=1e-3)
    held = balance(x, rosenbrock(x))
    assert points < 60 and held.left < 0.01 and held.limits[0] == pytest.approx(0.1215, rel=0.02)


def test_the_worst_of_several_goals():
    """Three planes, the highest of which is lowest where all are 1/3."""

    def at(x):
        rates = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]])
        return Judged(rates @ x + [0.0, 0.0, 1.0], rates, *NONE)

    x, points = lowest(at, (0.9, 0.05))
    np.testing.assert_allclose(x, 1 / 3, atol=1e-4)
    assert points < 20 and balance(x, at(x)).left < 1e-6


def test_what_cannot_be_computed_is_a_wall():
    def at(x):
        if x.sum() > 1.2:
            return None
        return Judged(np.array([-x[0] - 2 * x[1]]), np.array([[-1.0, -2.0]]), *NONE)

    seen = []

    def noted(x):
        seen.append(x)
        return at(x)

    descend(noted, np.array([0.1, 0.1]))
    reached = [x.sum() for x in seen[:40] if at(x) is not None]
    assert 1.15 < max(reached) <= 1.2 and len(reached) < 40


def test_bounds_hold():
    def at(x):
        return Judged(np.array([x[0] - 3 * x[1]]), np.array([[1.0, -3.0]]), *NONE)

    x, _ = lowest(at, (0.5, 0.5))
    held = balance(x, at(x))
    np.testing.assert_allclose(x, [0, 1], atol=1e-9)
    np.testing.assert_allclose(held.bounds, [-1, 3], rtol=1e-4)
    assert held.left < 1e-6
    assert balance(np.array([0.5, 1.0]), at(x)).left == pytest.approx(1 / 3, rel=1e-3)


def test_constraints_in_conflict():
    """x at least 0.8 and at most 0.3; y at most 0.9 has nothing to do with it."""
    rates = np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]])
    weights = in_conflict(
        np.array([0.5, 0.5]), Judged(np.zeros(1), np.zeros((1, 2)), np.array([-0.3, 0.4, -0.2]), rates)
    )
    np.testing.assert_allclose(weights, [0.5, 0, 0.5], atol=1e-9)
