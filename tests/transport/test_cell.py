"""Light between diffuse walls, against closed forms and quadrature that know nothing of patches."""

from __future__ import annotations

import math

import numpy as np
import pytest
from patch_cells import CONE, LAMBERTIAN, UP, cell, dome, led, phototransistor, plate

from mitsuba_taxel.evidence.domes.sphere_light import Dome
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import HORIZON_SHARE
from mitsuba_taxel.transport.exchange import Starts
from mitsuba_taxel.transport.laws.ends import CosineFactor, End
from mitsuba_taxel.transport.reception import Reception
from mitsuba_taxel.transport.rules import rectangle_rule


@pytest.mark.parametrize(
    ("height", "law", "isotropic", "expected"),
    [
        (0.7, LAMBERTIAN, 0, 0.019702463),
        (0.7, LAMBERTIAN, 1, 0.013124617),
        (0.7, CONE, 0, 0.013598936),
        (0.7, CONE, 1, 0.0092022309),
        (1.05, CONE, 1, 0.0047395992),
        (2.0, LAMBERTIAN, 0, 0.0034533907),
        (2.0, CONE, 0, 0.0020717984),
    ],
)
def test_a_plate_by_quadrature(height, law, isotropic, expected):
    assert cell(plate(4.0, height, 6), isotropic, 0.7, law).reading == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("radius", "rim"), [(1.275, 0.0), (2.55, 0.3)])
@pytest.mark.parametrize("isotropic", [0, 1])
def test_a_dome_by_its_closed_form(radius, rim, isotropic):
    expected = Dome(radius, rim, 0.9).diffuse_power("isotropic" if isotropic else "lambertian")
    fine, coarse = (cell(dome(radius, rim), isotropic, 0.9, CONE, degree=degree).reading for degree in (2, 1))
    assert fine == pytest.approx(expected, rel=1e-4)
    assert coarse == pytest.approx(expected, rel=2e-3)


def test_a_closed_dome_catches_all_light_of_the_led():
    power = cell(dome(1.275, 0.0), 1, 0.9, CONE).emitted
    assert power.sum() == pytest.approx(1, abs=2e-5)


def swaying(places):
    x, y, z = np.moveaxis(places, -1, 0)
    return np.stack([np.sin(1.3 * x + 0.3) * z, np.cos(y), 0.3 + x * y], axis=-1)


@pytest.mark.parametrize(
    ("law", "rim"), [(LAMBERTIAN, 0.05), (CONE, 0.0), (CosineFactor(7 / (2 * math.pi), 6.0), 0.05)]
)
@pytest.mark.parametrize("isotropic", [0.4, 1])
def test_derivatives_by_places_are_those_of_differences(law, rim, isotropic):
    places, step = dome(1.275, rim, 2), 1e-4
    gradient = cell(places, isotropic, 0.9, law, hole=0.1, reflectance=0.8).gradient()
    velocity = swaying(places)
    ahead, behind = (
        cell(places + sign * step * velocity, isotropic, 0.9, law, places, hole=0.1, reflectance=0.8).reading
        for sign in (1, -1)
    )
    assert (gradient * velocity).sum() == pytest.approx((ahead - behind) / (2 * step), rel=2e-4)


def test_points_of_a_plate_see_each_other_on_the_side_on_which_it_is_bent_inwards():
    """Like a saddle: part of the light comes with the bend, part with its opposite."""
    flat, step = plate(2.5, 0.6, 3), 1e-5
    velocity = np.zeros_like(flat)
    velocity[..., 2] = flat[..., 0] ** 2 - 0.5 * flat[..., 1] ** 2 + 0.3 * flat[..., 0]
    plain = cell(flat, 1, 0.7, LAMBERTIAN)
    ahead, behind = (cell(flat + sign * step * velocity, 1, 0.7, LAMBERTIAN, rest=flat).reading for sign in (1, -1))
    slopes = np.array([ahead - plain.reading, plain.reading - behind]) / step
    sides = np.array([plain.bent(velocity, side).sum() for side in (1, -1)])
    assert (plain.gradient() * velocity).sum() + sides == pytest.approx(slopes, rel=2e-4)
    assert sides[0] < 0 < sides[1] or sides[1] < 0 < sides[0]
    assert abs(sides).min() > 0.05 * abs(slopes).max()


def bent_plate(cuts, angle):
    """The cell under a plate bent like an S, by the phase of the bend, and the rate of the plate."""
    flat = plate(2.5, 0.6, cuts)
    along, rate = flat[..., 0] * np.cos(angle) + flat[..., 1] * np.sin(angle), np.zeros_like(flat)
    rate[..., 2] = -0.12 * np.cos(2.4 * along)

    def bent(phase):
        raised = np.zeros_like(flat)
        raised[..., 2] = 0.12 * np.sin(2.4 * along - phase)
        return cell(flat + raised, 1, 0.7, CONE, rest=flat)

    return bent, rate


def test_ways_that_sink_below_the_horizon_count_in_derivatives():
    """A plate that is bent like an S, askew to its patches, when the bend moves on."""
    bent, rate = bent_plate(6, 0.4)
    plain = bent(0.0)
    expected = (bent(0.1).reading - bent(-0.1).reading) / 0.2
    found = (plain.gradient() * rate).sum()
    without = (plain.gradient(wider=1e-9) * rate).sum()
    assert without == pytest.approx(1.9 * expected, rel=0.02)
    assert found == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("angle", [0.2, 0.4, 0.7, 1.1])
def test_a_horizon_of_twice_the_width_tells_what_its_derivative_is_off_by(angle):
    bent, rate = bent_plate(4, angle)
    plain = bent(0.0)
    found, wider = ((plain.gradient(width) * rate).sum() for width in (1, 2))
    off = found - (bent(0.1).reading - bent(-0.1).reading) / 0.2
    assert abs(off) < 2 * HORIZON_SHARE * abs(wider - found)


def visible(end, at, tilt):
    """What a point of a wall sends to a phototransistor of which it sees all below a plane, and its rate of tilt."""
    normal, turned = (
        np.array([[math.sin(tilt), 0.0, math.cos(tilt)]]),
        np.array([math.cos(tilt), 0.0, -math.sin(tilt)]),
    )
    seen = Reception(end, Starts(at, normal, np.ones(1), np.zeros(1)))
    return seen.value[0], float((seen.gradient(np.ones(1))[1] @ turned)[0])


def test_rows_of_a_phototransistor_that_sink_below_a_horizon_at_once():
    """Its 64 points have the derivative of 128 x 128 points to a fifth of the largest one, though it is of whole rows,
    or of none, of them."""
    at = np.array([[-0.45, 0.0, 1.3]])
    few = phototransistor(0.9)
    places, weights = rectangle_rule(0.52, 0.3, 128, 128)
    many = End(np.column_stack([places + (0.45, 0), np.zeros(len(places))]), weights, UP, few.law)
    tilts = np.linspace(0.8, 1.15, 36)
    found, exact = (np.array([visible(end, at, tilt)[1] for tilt in tilts]) for end in (few, many))
    np.testing.assert_allclose(found, exact, atol=0.2 * exact.max())
    assert np.trapezoid(found, tilts) == pytest.approx(visible(many, at, 1.3)[0], rel=0.01)


def test_changes_of_the_ends_to_first_order():
    places = dome(1.275, 0.05, 2)
    base = cell(places, 1, 0.9, CONE, reflectance=0.8)
    still = np.ones(len(places))
    for change in (1e-3, -1e-3):
        moved = cell(places, 1, 0.9 + change, CONE, reflectance=0.8).reading - base.reading
        found = base.change(led(0.9 + change, CONE), phototransistor(0.9 + change), None, still)
        assert found == pytest.approx(moved, rel=5e-3)
        brighter = cell(places, 1, 0.9, CONE, reflectance=0.8 * (1 + change)).reading - base.reading
        found = base.change(led(0.9, CONE), phototransistor(0.9), None, (1 + change) * still)
        assert found == pytest.approx(brighter, rel=5e-3)
