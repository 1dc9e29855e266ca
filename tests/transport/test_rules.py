"""Rules of quadrature, against integrals that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.transport import rules

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("degree", [1, 2])
def test_triangle_rules_are_exact_to_twice_their_degree(degree):
    points, weights = rules.triangle_rule(degree)
    for i in range(2 * degree + 1):
        for j in range(2 * degree + 1 - i):
            exact = math.factorial(i) * math.factorial(j) / math.factorial(i + j + 2)
            assert weights @ (points[:, 0] ** i * points[:, 1] ** j) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_polynomial_is_found_again_from_its_values(degree):
    points, _ = rules.triangle_rule(degree)
    wanted = np.random.default_rng(1).normal(size=len(points))
    values = rules.monomials(points, degree) @ wanted
    assert rules.coefficients(degree) @ values == pytest.approx(wanted)


def test_slopes_of_monomials():
    at, step = np.array([[0.3, 0.2], [0.1, 0.7]]), 1e-6
    own, *by = (rules.monomials(at, 4) @ each for each in rules.differentiated(4))
    assert own == pytest.approx(rules.monomials(at, 4))
    for slopes, direction in zip(by, np.eye(2), strict=True):
        ahead, behind = (rules.monomials(at + sign * step * direction, 4) for sign in (1, -1))
        assert slopes == pytest.approx((ahead - behind) / (2 * step), abs=1e-9)


@pytest.mark.parametrize("target", rules.triangle_rule(2)[0].tolist())
def test_the_polar_rule_integrates_what_grows_as_1_over_the_distance(target):
    """In the equilateral triangle: over each triangle from the target to a side, of height h, the integral of 1 / r is
    h times the difference of asinh(x / h) at its ends."""
    shape = np.array([[1.0, 0.0], [0.5, math.sqrt(3) / 2]])
    points, weights = rules.polar_rule(np.array(target), 8)
    distance = np.linalg.norm((points - target) @ shape, axis=1)
    corners, middle, exact = np.array([[0, 0], [1, 0], [0, 1]]) @ shape, np.array(target) @ shape, 0.0
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (end - start) / np.linalg.norm(end - start)
        height = abs(np.linalg.det([start - middle, along]))
        exact += height * (math.asinh((end - middle) @ along / height) - math.asinh((start - middle) @ along / height))
    assert np.linalg.det(shape) * weights @ (1 / distance) == pytest.approx(exact, rel=1e-9)
    assert weights.sum() == pytest.approx(0.5, rel=1e-9)


def test_annuli_have_their_area_and_second_moment():
    points, weights = rules.square_annulus_rule(0.25, 0.1, 2, 2)
    assert weights.sum() == pytest.approx(0.25**2 - 0.1**2)
    assert weights @ points**2 == pytest.approx([(0.25**4 - 0.1**4) / 12] * 2)
    points, weights = rules.disc_annulus_rule(0.25, 0.1, 2, 8)
    assert weights.sum() == pytest.approx(math.pi / 4 * (0.25**2 - 0.1**2))
    assert weights @ points**2 == pytest.approx([math.pi / 64 * (0.25**4 - 0.1**4)] * 2)
