"""Lists of contacts as maps: against the geometry of balls, and the balance of forces and moments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_contact import linear_model, made_up

from mitsuba_taxel import InputError
from mitsuba_taxel.surrogates import depth_maps, force_maps
from mitsuba_taxel.surrogates.contact_readings import NOT_A_NUMBER, NOT_SOLVED, PULLS, TOO_DEEP, TOO_FAR
from mitsuba_taxel.surrogates.contact_states import Touch, touches
from mitsuba_taxel.surrogates.second_order import with_second_order

pytestmark = pytest.mark.quick


def ball(model, centre, radius):
    """Map of the depth of a ball, from the definition: the length of each vertical line below the top inside it."""
    along = np.linspace(-1.5, 0, 30001)
    below = np.full(model.covered.shape, -1.0)
    for place in np.ndindex(*below.shape):
        line = model.points[place] + np.outer(along, [0, 0, 1])
        inside = ((line - centre) ** 2).sum(axis=1) < radius**2
        if inside.any():
            below[place] = -along[inside].min()
    return below


@pytest.mark.parametrize("normal", [(0.0, 0.0, -1.0), (0.3, -0.4, -np.sqrt(0.75))])
@pytest.mark.parametrize("radius", [1.5, 4.0])
def test_contacts_of_balls_are_their_depth_maps(normal, radius):
    model, normal = linear_model(), np.array(normal)
    centre = np.array([0.3, -0.2, model.height]) - 1.3 * normal * radius / 1.5 + [0, 0, 0.02]
    lowest = centre + radius * normal
    for depth in (0.2, 0.31):
        place = lowest - 0.5 * depth * normal  # midway: the surface of the pad is a depth further up
        found = depth_maps(model, [place], [depth], radius, normals=[normal])[0]
        expected = ball(model, centre, radius)
        np.testing.assert_allclose(np.maximum(found, 0), np.maximum(expected, 0), atol=2e-4)
        assert (expected > 0.05).sum() > 3


def test_several_contacts_and_pads_at_once():
    """Two balls on the second pad, one on the first, one above the third, and one at an unknown depth."""
    model = linear_model()
    bodies = [Touch("sphere", 2.0, -0.8, 0.3, 0.0, 0.2), Touch("sphere", 3.0, 0.9, -0.4, 0.0, 0.3)]
    depths = np.array([0.2, 0.3, 0.3, -0.1, np.nan])
    points = [(b.x, b.y, model.height - d / 2) for b, d in zip([*bodies, bodies[1], *bodies], depths, strict=True)]
    radius = [2.0, 3.0, 3.0, 2.0, 3.0]
    maps = depth_maps(model, points, depths, radius, pad=[1, 1, 0, 2, 3], pads=4)
    own = [body.below(model.points, body.depth) for body in bodies]
    np.testing.assert_allclose(np.maximum(maps[1], 0), np.maximum(np.maximum(*own), 0), atol=1e-12)
    np.testing.assert_allclose(np.maximum(maps[0], 0), np.maximum(own[1], 0), atol=1e-12)
    assert (maps[2] == -1).all() and model(maps).status.tolist() == [0, 0, 0, NOT_A_NUMBER]
    (second, both), first = -model(maps[:2]).force[:, 2], -model(own[0]).force[0, 2]
    assert second < both < 0.9 * (first + second)  # each lowers the top below the other


def test_forces_keep_their_sum_and_their_moment():
    model, rng = linear_model(), np.random.default_rng(0)
    points = np.append(rng.uniform(-1.9, 1.9, (20, 2)), np.full((20, 1), model.height), axis=1)
    forces = rng.uniform(-0.1, 0.0, (20, 3))
    maps = force_maps(model, points, forces, pad=np.arange(20) % 3, pads=3)
    for pad in range(3):
        own, x, y = slice(pad, None, 3), model.points[..., 0], model.points[..., 1]
        assert maps[pad].sum() == pytest.approx(-forces[own, 2].sum())
        assert (maps[pad] * x).sum() == pytest.approx(-(forces[own, 2] * points[own, 0]).sum())
        assert (maps[pad] * y).sum() == pytest.approx(-(forces[own, 2] * points[own, 1]).sum())
    readings = model.from_forces(maps)
    change = np.array([maps[pad].ravel() @ model.gradient.T for pad in range(3)])
    np.testing.assert_allclose(readings.power, model.rest + change)
    np.testing.assert_allclose(readings.force[:, 2], -maps.sum(axis=(1, 2)))
    beside = force_maps(model, [(0, 0, 3), (2.3, 0, 3), (2.1, 0, 3)], [(0, 0, -1)] * 3, pad=[0, 1, 2], pads=3)
    assert np.isnan(beside[1]).all() and beside[2].sum() == pytest.approx(1) and beside[0].sum() == pytest.approx(1)


@pytest.mark.parametrize("force", [(0.0, 0.0, 0.0, 0.0), (0.05, 1.1, -0.3, 0.2), (-0.1, -0.4, 0.2, 0.0)])
def test_readings_from_the_forces_of_a_touch_are_those_from_its_depth(force):
    """Also with second-order terms: plates have one depth at all patches, so that the depth follows from the forces."""
    linear = linear_model()
    model = with_second_order(linear, made_up(linear, 10, (0.0, 0.8, 0.4, 0.3), force))
    x, y = model.points[..., 0], model.points[..., 1]
    maps = np.array([np.where(np.maximum(abs(x), abs(y)) < side, 0.2, -1.0) for side in (0.7, 1.1, 1.5)])
    given = model(maps)
    found = model.from_forces(given.pressure * np.prod(model.size))
    for name in ("power", "force", "moment", "centre", "area", "pressure"):
        own = getattr(given, name)
        scale = 1.0 if name in ("moment", "centre") else np.nanmax(np.abs(own))
        np.testing.assert_allclose(getattr(found, name), own, rtol=1e-9, atol=1e-9 * scale)
    balls = np.array([body.below(model.points, body.depth) for body in touches(model, 10)])
    given = model(balls)
    found = model.from_forces(given.pressure * np.prod(model.size))
    scale = np.abs(given.power - model.rest).max()
    np.testing.assert_allclose(found.power, given.power, rtol=0, atol=0.01 * scale)


def test_forces_that_the_model_does_not_hold_for_are_flagged():
    model = replace(linear_model(), places=np.array([[-1.0, -1.0], [1.0, 1.0]]))
    small = np.where(np.hypot(model.points[..., 0], model.points[..., 1]) < 0.9, 1e-3, 0.0)
    maps = np.stack([small] * 5)
    maps[1, 0, 0] = np.nan
    maps[2] *= 1e3
    maps[3] = np.roll(small, 3, axis=1)
    maps[4, 5, 5] = -1e-3
    readings = model.from_forces(maps)
    assert readings.status.tolist() == [0, NOT_A_NUMBER, TOO_DEEP, TOO_FAR, PULLS]
    assert np.isnan(readings.power[1]).all() and np.isfinite(readings.power[[0, 2, 3, 4]]).all()
    linear = linear_model()
    second = with_second_order(linear, made_up(linear, 10, (0.0, 0.8, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))).second
    falling = replace(model, second=second._replace(force=np.array([0.0, -5.0, 0.0, 0.0])))
    assert falling.from_forces(maps[2]).status[0] == NOT_SOLVED and np.isnan(falling.from_forces(maps[2]).power).all()


def test_displacements_are_the_depth_in_contact_and_the_compliance_beside_it():
    model = linear_model()
    with pytest.raises(InputError, match="no lateral displacements: export it again"):
        model.displacement(np.zeros(model.covered.shape))
    model = replace(model, lateral=np.stack([0.1 * model.compliance, -0.2 * model.compliance]))
    flat = np.where(np.hypot(model.points[..., 0], model.points[..., 1]) < 1.0, 0.1, -1.0)
    moved = model.displacement(np.stack([flat, np.where(flat > 0, np.nan, 0)]))
    assert np.isnan(moved[1]).all()
    np.testing.assert_allclose(moved[0][flat > 0, 2], -0.1)
    outside = moved[0][flat <= 0, 2]
    assert ((outside < 0) & (outside > -0.1)).all()
    np.testing.assert_allclose(moved[0][..., :2], -moved[0][..., 2:] * [0.1, -0.2])


def test_a_contact_beside_the_top_is_flagged_for_its_pad_alone():
    model = linear_model()
    points, normals = [(0, 0, model.height - 0.1)] * 2, [(0, 0, -1), (-1, 0, 0)]
    maps = depth_maps(model, points, [0.2, 0.2], 2.0, normals=normals, pad=[0, 1], pads=2)
    assert model(maps).status.tolist() == [0, NOT_A_NUMBER]


def test_without_contacts_maps_are_empty():
    model = linear_model()
    assert (depth_maps(model, [], [], 2.0, pad=[], pads=3) == -1).all()
    assert (force_maps(model, [], [], pads=3) == 0).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": [(0, 0)]}, "points of shape .* rows of x, y, z"),
        ({"points": [(0, 0, 3), (0, 0)]}, "points with rows of different lengths .* rows of x, y, z"),
        ({"depths": [0.1, 0.2]}, "depths of shape .* one number for each of 1 points"),
        ({"depths": "deep"}, "depths of shape"),
        ({"radius": 0.0}, "radius = .* above 0"),
        ({"radius": np.inf}, "radius = .* above 0"),
        ({"normals": [(0, 0, -1.1)]}, "unit vectors"),
        ({"normals": [(0, 0, -1), (0, 0, -1)]}, "normals of shape .* do not belong to 1 points"),
        ({"pad": [1]}, "pad = 1 .* from 0 to 0"),
        ({"pad": [0.0]}, "pad of shape .* a whole number"),
        ({"pad": [[0], [0, 1]]}, "pad with rows of different lengths .* a whole number"),
        ({"pads": 0}, "pad of shape .* a whole number"),
        ({"pads": 1.0}, "pads"),
    ],
)
def test_lists_that_do_not_fit_are_refused(changes, message):
    model = linear_model()
    given = {"points": [(0, 0, 3)], "depths": [0.1], "radius": 2.0} | changes
    with pytest.raises(InputError, match=message):
        depth_maps(model, given.pop("points"), given.pop("depths"), given.pop("radius"), **given)


def test_forces_that_do_not_fit_are_refused():
    model = linear_model()
    with pytest.raises(InputError, match="forces of shape .* do not belong to 1 points"):
        force_maps(model, [(0, 0, 3)], [(0, 0, -1), (0, 0, -1)])
    with pytest.raises(InputError, match="force of shape .* of 11 rows and 11 columns"):
        model.from_forces(np.zeros((3, 3)))
    cut = replace(model, covered=model.covered & (model.x < 2), compliance=np.eye(110), gradient=np.ones((2, 110)))
    with pytest.raises(InputError, match="force beside the top"):
        cut.from_forces(np.ones((11, 11)))


@pytest.mark.parametrize("slope", [(0.05, 0.0), (0.0, -0.04), (0.03, 0.06)])
def test_a_wedge_without_friction_presses_along_its_normal(slope):
    model = linear_model()
    points = model.points[..., :2]
    depth = np.where((np.abs(points) < 1.3).all(axis=-1), 0.2 + points @ np.array(slope), -1.0)
    readings = model(depth)
    force = readings.force[0]
    np.testing.assert_allclose(force[:2], force[2] * np.array(slope), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("place", [(1.9, 0.3), (-1.2, -2.1)])
def test_the_force_of_a_ball_points_at_its_centre(place):
    """Beside the rim, where the contact is cut off, its tangential part is not 0."""
    model = linear_model()
    body = Touch("sphere", 4.0, *place, 0.0, 0.3)
    readings = model(body.below(model.points, 0.3))
    centre = np.array([*place, model.height - 0.3 + 4.0])
    force, moment = readings.force[0], readings.moment[0]
    about_centre = moment - np.cross(centre, force)
    assert np.linalg.norm(force[:2]) > 0.02 * abs(force[2])
    without = np.cross(np.array([*readings.centre[0], model.height]) - centre, [0, 0, force[2]])
    assert np.linalg.norm(about_centre) < 0.05 * np.linalg.norm(without)
