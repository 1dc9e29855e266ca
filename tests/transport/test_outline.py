"""Power within outlines, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from patch_cells import LAMBERTIAN, UP, dome, patches, plate

from mitsuba_taxel.transport.laws.ends import CosineFactor, uniform_cone
from mitsuba_taxel.transport.laws.polar_cone import PolarCone
from mitsuba_taxel.transport.laws.tabulated_law import TabulatedLaw
from mitsuba_taxel.transport.outline import power_within

pytestmark = pytest.mark.quick

EVEN = CosineFactor(1 / (2 * math.pi), 0.0)


def within(law, places, *points, normal=UP):
    return power_within(np.array(points, dtype=float), normal, law.within, places)


def test_an_even_source_lights_the_solid_angle_of_a_rectangle():
    """4 arcsin of the product of the sines of both half-angles; A. Khadjavi, Journal of the Optical Society of America
    58, 1968."""
    expected = 4 * math.asin(1 / (1 + 0.8**2)) / (2 * math.pi)
    shares = within(EVEN, plate(2.0, 0.8), (0, 0, 0), (0.3, -0.2, 0))
    assert shares.shape == (2, 32) and (shares > 0).all()
    assert shares[0].sum() == pytest.approx(expected, rel=1e-8)
    assert shares[1].sum() < expected


def test_a_lambertian_source_lights_the_view_factor_of_a_rectangle():
    """From a point below its middle; J. R. Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-3."""
    side = 1 / 0.8
    half = side / math.sqrt(1 + side**2)
    expected = 4 / (2 * math.pi) * 2 * half * math.atan(half)
    assert within(LAMBERTIAN, plate(2.0, 0.8), (0, 0, 0)).sum() == pytest.approx(expected, rel=1e-8)


NARROW = [
    *(uniform_cone(math.cos(math.radians(angle))) for angle in (0.05, 1, 12)),
    *(CosineFactor((exponent + 1) / (2 * math.pi), exponent) for exponent in (1e3, 1e6)),
    PolarCone(math.radians(0.05)),
]


@pytest.mark.parametrize("law", [*NARROW, EVEN, LAMBERTIAN])
def test_all_patches_of_a_dome_receive_all_light_wherever_the_beam_falls(law):
    shares = within(law, dome(1.275, 0.0), (0.01, 0.02, 1e-3), (0.3, 0.123, 0.2), (-0.4, 0, 0.1))
    assert shares.sum(axis=1) == pytest.approx(1, abs=1e-6)
    assert shares.min() > -1e-6


@pytest.mark.parametrize("law", NARROW)
def test_a_side_through_the_axis_halves_a_beam(law):
    halves = patches(np.array([[(0, -1, 1), (0, 1, 1), (1, 0, 1)], [(0, -1, 1), (-1, 0, 1), (0, 1, 1)]], dtype=float))
    shares = within(law, halves, (0, 0.01, 0), (0, -0.3, 0), (0.5, 0, 0))
    assert shares[:2] == pytest.approx(np.full((2, 2), 0.5), abs=1e-5)
    assert shares[2] == pytest.approx([1, 0], abs=1e-5)


def test_turned_with_its_source_a_plate_receives_the_same_and_from_behind_the_opposite():
    places, law = plate(2.0, 0.8), uniform_cone(0.6)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    shares = within(law, places, (0.3, -0.2, 0))
    turned = within(law, places @ turn.T, turn @ (0.3, -0.2, 0), normal=turn @ UP)
    np.testing.assert_allclose(turned, shares, atol=1e-9)
    behind = within(law, places[:, np.argsort([0, 5, 9, 12, 14, 1, 6, 10, 13, 2, 7, 11, 3, 8, 4])], (0.3, -0.2, 0))
    np.testing.assert_allclose(behind, -shares, atol=1e-9)


@pytest.mark.parametrize("angle", [30.0, 85.0])
def test_a_table_contains_what_its_integral_says(angle):
    nodes = np.cos(np.radians(np.linspace(angle, 0, 9)))
    law = TabulatedLaw(nodes, np.array([0.2, 0, 1, 3, 2, 2, 5, 0, 1.0]))
    cosine = np.linspace(nodes[0], 1, 400001)
    values = law(cosine)[0]
    steps = np.concatenate([[0], np.cumsum((values[1:] + values[:-1]) / 2 * np.diff(cosine))])
    np.testing.assert_allclose(law.within(cosine[::5000]), 2 * np.pi * (steps[-1] - steps)[::5000], atol=1e-8)
    assert law.within(np.array([-1.0, 1.0])) == pytest.approx([law.within(nodes[:1])[0], 0], abs=1e-12)
