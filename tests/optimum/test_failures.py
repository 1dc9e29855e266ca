"""Descents along what fails."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.optimum.descent import Trial, descend
from mitsuba_taxel.optimum.failures import nearest, off_failures
from mitsuba_taxel.optimum.search import Linearisation

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])


@pytest.mark.parametrize(
    ("others", "one", "other"),
    [
        ([[1.5, 0.4]], [1.0, 0.4], [1.5, 0.4]),
        ([[2.0, 0.0], [0.0, 2.0]], [1.0, 1.0], [1.0, 1.0]),
        ([[2.0, 2.0], [3.0, 1.0]], [1.0, 1.0], [2.0, 2.0]),
    ],
)
def test_nearest_points_of_hulls(others, one, other):
    found = nearest(SQUARE, np.array(others))
    np.testing.assert_allclose(found, [one, other], atol=1e-5)


def test_the_plane_lies_midway():
    here = Linearisation(np.zeros(1), np.zeros((1, 2)), np.ones(1), np.ones((1, 2)))
    with_plane = off_failures(np.array([1.0, 0.4]), here, list(SQUARE), [np.array([1.5, 0.4])])
    np.testing.assert_allclose(with_plane.limits, [1.0, 0.25], atol=1e-5)
    np.testing.assert_allclose(with_plane.limit_rates, [[1, 1], [-1, 0]], atol=1e-5)
    within = off_failures(np.zeros(2), here, list(SQUARE), [np.full(2, 0.5)])
    np.testing.assert_allclose(within.limits, [1.0, np.sqrt(2) / 4], atol=1e-5)  # from this point alone
    assert off_failures(np.zeros(2), here, list(SQUARE), []) is here
    assert off_failures(np.zeros(2), here, list(SQUARE), [np.full(2, 1e-5)]) is here


@pytest.mark.parametrize("seed", range(6))
def test_along_a_half_space_that_fails(seed):
    """In 40 points, the least of a paraboloid of six variables that lies 0.1 beyond where everything fails."""
    random = np.random.default_rng(seed)
    normal = random.normal(size=6)
    normal /= np.linalg.norm(normal)
    least, bend = np.full(6, 0.5), np.geomspace(1, 4, 6)
    start = least + 0.2 * random.normal(size=6)
    start -= (normal @ (start - least) + 0.3) * normal
    visited = []

    def at(x):
        d = x - least
        if normal @ d > -0.1:
            visited.append(np.inf)
            return None
        visited.append(1 + d @ (bend * d))
        return Linearisation(np.array(visited[-1:]), 2 * (bend * d)[None], np.zeros(0), np.zeros((0, 6)))

    descend(lambda x, beside: Trial(at(x), jump=0.0), start)
    truth = 1 + 0.1**2 / (normal @ (normal / bend))
    assert min(visited[:40]) == pytest.approx(truth, rel=0.01)
