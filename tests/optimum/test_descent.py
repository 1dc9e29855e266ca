"""Descents to optima that are known."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.optimum.descent import JUMP, JUMP_MOVED, Trial, descend
from mitsuba_taxel.optimum.search import Linearisation, stationarity

pytestmark = pytest.mark.quick

NONE = (np.zeros(0), np.zeros((0, 2)))


def down(at, start, tolerance=3e-4, jump=JUMP):
    """Where a descent ends."""
    return descend(lambda x, beside: Trial(at(x), jump=jump), np.array(start), tolerance)


def lowest(at, start):
    """Where the descent saw the least of what is allowed, and how many points it took."""
    visited = {}

    def noted(x):
        visited[tuple(x)] = at(x)
        return visited[tuple(x)]

    down(noted, start, 1e-8, 0.0)
    allowed = {x: found for x, found in visited.items() if found is not None and found.violation < 1e-6}
    return np.array(min(allowed, key=lambda x: allowed[x].worst)), len(visited)


def rosenbrock(cube):
    """On [-2, 2] squared, within the unit circle: least at (0.7864, 0.6177)."""
    x, y = 4 * cube - 2
    value = 100 * (y - x**2) ** 2 + (1 - x) ** 2
    rate = 4 * np.array([-400 * x * (y - x**2) - 2 * (1 - x), 200 * (y - x**2)])
    return Linearisation(np.array([value]), rate[None], np.array([1 - x**2 - y**2]), -8 * np.array([[x, y]]))


def test_rosenbrock_in_a_circle():
    x, points = lowest(rosenbrock, (0.5, 0.5))
    np.testing.assert_allclose(4 * x - 2, [0.78642, 0.61770], atol=1e-3)
    held = stationarity(x, rosenbrock(x))
    assert points < 60 and held.unbalanced < 0.01 and held.limits[0] == pytest.approx(0.1215, rel=0.02)


def test_the_worst_of_several_goals():
    """Three planes, the highest of which is lowest where all are 1/3."""

    def at(x):
        rates = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]])
        return Linearisation(rates @ x + [0.0, 0.0, 1.0], rates, *NONE)

    x, points = lowest(at, (0.9, 0.05))
    np.testing.assert_allclose(x, 1 / 3, atol=1e-4)
    assert points < 20 and stationarity(x, at(x)).unbalanced < 1e-6


def test_what_cannot_be_computed_is_a_wall():
    def at(x):
        if x.sum() > 1.2:
            return None
        return Linearisation(np.array([-x[0] - 2 * x[1]]), np.array([[-1.0, -2.0]]), *NONE)

    visited = []

    def noted(x):
        visited.append(x)
        return at(x)

    down(noted, [0.1, 0.1])
    reached = [x.sum() for x in visited[:40] if at(x) is not None]
    assert 1.15 < max(reached) <= 1.2 and len(reached) < 40


def test_bounds_are_reached():
    def at(x):
        return Linearisation(np.array([x[0] - 3 * x[1]]), np.array([[1.0, -3.0]]), *NONE)

    x, points = lowest(at, (0.5, 0.5))
    np.testing.assert_allclose(x, [0, 1], atol=1e-9)
    assert points < 6


def test_from_a_start_that_violates_a_limit():
    """The point of the disc that is nearest to a corner, from outside of the disc."""

    def at(x):
        corner, middle = x - [1, 1], x - [0.3, 0.5]
        return Linearisation(
            np.array([corner @ corner]), 2 * corner[None], np.array([0.04 - middle @ middle]), -2 * middle[None]
        )

    x, points = lowest(at, (1.0, 0.1))
    away = np.array([0.7, 0.5])
    np.testing.assert_allclose(x, [0.3, 0.5] + 0.2 * away / np.linalg.norm(away), atol=1e-5)
    assert points < 20


@pytest.mark.parametrize("start", [(0.35, 0.9), (0.6, 0.0), (0.32, 0.1)])
def test_curvature_of_far_away_does_not_end_a_descent(start):
    """A valley beside a slope of 3000 times its curvature, on which the descent begins. Without a second beginning a
    slope of 17 to 27 % is left."""

    def at(x):
        up = max(x[0] - 0.3, 0.0)
        value = 2 + (x[0] - 0.1) ** 2 + 0.3 * x[0] * x[1] + 0.5 * (x[1] - 0.5) ** 2 + 3000 * up**2
        rate = [2 * (x[0] - 0.1) + 0.3 * x[1] + 6000 * up, 0.3 * x[0] + x[1] - 0.5]
        return Linearisation(np.array([value]), np.array([rate]), *NONE)

    visited = []

    def noted(x):
        visited.append(x)
        return at(x)

    x = down(noted, start, jump=JUMP_MOVED)
    np.testing.assert_allclose(x, np.linalg.solve([[2, 0.3], [0.3, 1]], [0.2, 0.5]), atol=0.03)
    assert len(visited) < 16 and stationarity(x, at(x)).unbalanced < 0.02


BEST = np.array([0.3, 0.5, 0.7, 0.2, 0.6, 0.4, 0.8, 0.5])


def eight(x, jump=0.0):
    """The larger of two functions of eight variables, with one limit; values and rates jump from point to point."""
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(8, 8)))
    bend = turn @ np.diag(np.geomspace(0.1, 10, 8)) @ turn.T
    d, tilts = x - BEST, np.array([0.2 * np.ones(8), -0.4 * np.eye(8)[2]])
    goals = np.array([-2 + share * d @ bend @ d for share in (1, 0.5)]) + tilts @ d
    rates = np.array([2 * share * bend @ d for share in (1, 0.5)]) + tilts
    noise = np.random.default_rng(np.frombuffer(np.round(x, 9).tobytes(), np.uint32))
    goals = goals * (1 + jump * noise.normal(size=2))
    rates = rates + 10 * jump * noise.normal(size=rates.shape)
    return Linearisation(goals, rates, np.array([x[0] - x[1] + 0.1]), (np.eye(8)[0] - np.eye(8)[1])[None])


@pytest.mark.parametrize("seed", range(4))
def test_eight_variables_of_readings_that_jump(seed):
    """Within 0.3 % of the optimum in 40 points, though values jump by 0.1 %; the optimum is that of exact values."""
    exact = down(eight, np.full(8, 0.5), 1e-9, 0.0)
    truth = eight(exact)
    assert stationarity(exact, truth).unbalanced < 1e-3 and truth.violation < 1e-6
    visited = []

    def at(x):
        visited.append(x)
        return eight(x, 1e-3)

    end = eight(down(at, np.random.default_rng(seed).random(8)))
    assert len(visited) <= 40 and end.violation < 1e-3
    assert end.worst == pytest.approx(truth.worst, rel=3e-3)
