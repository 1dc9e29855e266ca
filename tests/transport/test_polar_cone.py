"""Light that is uniform in the polar angle, against its closed form on a square plate."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate

from mitsuba_taxel.transport.cell import Cell, Mesh, ScatteringWalls
from mitsuba_taxel.transport.emission import emission
from mitsuba_taxel.transport.laws.ends import CosineFactor, End
from mitsuba_taxel.transport.laws.polar_cone import BLUNT, PolarCone
from mitsuba_taxel.transport.patches import LATTICE
from mitsuba_taxel.transport.rules import rectangle_rule

SIDE = 2.0
UP = np.array([0.0, 0.0, 1.0])


def plate(height, count=4):
    """A square plate that faces down, as triangular patches."""
    lines = np.linspace(-SIDE / 2, SIDE / 2, count + 1)
    corners = []
    for x, y in np.ndindex(count, count):
        a, b, c, d = ((lines[x + i], lines[y + j], height) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
        corners += [(a, c, b), (a, d, c)]
    return np.column_stack([1 - LATTICE.sum(axis=1), LATTICE]) @ np.array(corners)


def on_plate(x, y, height, angle):
    """Share of the light of a point below (x, y): the mean polar angle of the outline, relative to the cone's."""
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * SIDE / 2 - (x, y)
    total = 0.0
    for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (other - one) / SIDE
        distance = one[0] * along[1] - one[1] * along[0]
        start, end = np.arctan2([one @ along, other @ along], distance)

        def polar(turn, distance=distance):
            return min(math.atan2(distance / math.cos(turn), height), angle)

        kinks = math.acos(min(distance / (height * math.tan(angle)), 1))
        total += integrate.quad(polar, start, end, points=[-kinks, kinks], epsabs=1e-12)[0]
    return total / (2 * math.pi * angle)


def lit(x, y, height, angle, moved=(0.0, 0.0, 0.0)):
    """The light of a point below (x, y) of a plate, which has come there by a movement."""
    led = End(np.array([[x, y, 0.0]]), np.ones(1), UP, PolarCone(math.radians(angle)))
    places = plate(height)
    return emission(led, places, places - moved, 2)


@pytest.mark.parametrize("angle", [2 * BLUNT, 0.5, 1.5])
def test_the_law_is_the_density_without_its_pole(angle):
    """The same beyond the axis; the same power, and the same mean cosine, within."""
    law = PolarCone(angle)
    beyond = np.linspace(BLUNT, angle, 50)
    np.testing.assert_allclose(law(np.cos(beyond))[0] * np.sin(beyond), 1 / (2 * math.pi * angle), rtol=1e-10)
    theta, weight = np.polynomial.legendre.leggauss(40)
    theta, weight = BLUNT * (theta + 1) / 2, BLUNT / 2 * weight
    per_angle = 2 * math.pi * np.sin(theta) * law(np.cos(theta))[0]
    assert weight @ per_angle == pytest.approx(BLUNT / angle, rel=1e-9)
    assert weight @ (per_angle * (1 - np.cos(theta))) == pytest.approx((BLUNT - math.sin(BLUNT)) / angle, rel=1e-6)
    assert law(np.ones(1))[0] > law(np.array([math.cos(BLUNT)]))[0]


@pytest.mark.parametrize("theta", [0.2 * BLUNT, 0.9 * BLUNT, 1.1 * BLUNT, 0.3, 1.2])
def test_its_slope_is_that_of_its_values(theta):
    law, step = PolarCone(1.5), 1e-3 * (1 - math.cos(theta))
    ends = [law(np.array([math.cos(theta) + sign * step]))[0][0] for sign in (1, -1)]
    assert law(np.array([math.cos(theta)]))[1][0] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-4)


@pytest.mark.parametrize(("x", "y", "height"), [(0.0, 0.0, 1.0), (0.3, 0.1, 0.5), (0.3, 0.1, 2.0), (0.95, 0.4, 1.0)])
@pytest.mark.parametrize("angle", [88.0, 35.0])
def test_a_square_plate_receives_the_mean_angle_of_its_outline(x, y, height, angle):
    share = lit(x, y, height, angle).power.sum()
    assert share == pytest.approx(on_plate(x, y, height, math.radians(angle)), rel=2e-5)


@pytest.mark.parametrize("moved", [(0.0, 0.0, 0.0), (0.37, -0.21, -0.3)])
@pytest.mark.parametrize(("x", "y", "height"), [(0.3, 0.1, 1.0), (-0.45, 0.2, 2.0), (0.9, 0.4, 1.0)])
def test_its_derivatives_by_the_plates_position(x, y, height, moved):
    step, angle = 1e-3, math.radians(88)
    light = lit(x, y, height, 88.0, moved)
    found = light.gradient(*(np.ones(len(each.weight)) for each in (light.inside, light.edge))).sum(axis=(0, 1))
    ends = np.array(
        [[on_plate(x - s * a, y - s * b, height + s * c, angle) for s in (step, -step)] for a, b, c in np.eye(3)]
    )
    np.testing.assert_allclose(found, (ends[:, 0] - ends[:, 1]) / (2 * step), rtol=1e-3, atol=3e-4)


def received(height, angle, led, phototransistor):
    """By polar and azimuth angle of the LED's light, in which it is even, on an endless Lambertian plate."""
    theta, of_theta = np.polynomial.legendre.leggauss(60)
    theta, of_theta = angle * (theta + 1) / 2, of_theta / 2
    turn = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    across = height * np.tan(theta)[:, None, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    at = np.concatenate([led.points[0, :2] + across, np.full((*across.shape[:2], 1), height)], axis=-1)
    squared = ((at[:, :, None] - phototransistor.points) ** 2).sum(axis=-1)
    return of_theta @ (height**2 / (np.pi * squared**2) @ phototransistor.weights).mean(axis=1)


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.07, 0.19), (0.31, -0.11)])
@pytest.mark.parametrize("height", [1.4, 1.6])
def test_a_wide_plate_reads_the_same_wherever_its_patches_are(height, x, y):
    """Patches of 0.65 mm. Were its direct light as coarse as that via other walls, it would be off by ten times as much
    in some places."""
    angle = math.radians(45)
    led = End(np.array([[-0.2, 0.0, 0.0]]), np.ones(1), UP, PolarCone(angle))
    at, weights = rectangle_rule(0.52, 0.3, 4, 4)
    sensor = End(np.column_stack([at + (0.7, 0.0), np.zeros(len(at))]), weights, UP, CosineFactor(1.0, 0.0))
    places = 2.275 * plate(height / 2.275, 7) + (x, y, 0.0)
    walls = ScatteringWalls(places, places, np.zeros(len(places)), np.ones(len(places)))
    found = Cell(Mesh(places), walls, led, sensor)
    expected = received(height, angle, led, sensor)
    assert found.reading == pytest.approx(expected, rel=6e-5)
    assert np.abs(found.gradient().sum(axis=(0, 1))[:2]).max() < 1e-3 * expected
