"""Friction by the tangential compliance: against Cattaneo and Mindlin, Reissner and Sagoci, and its conditions."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from half_space import grid, half_space

from mitsuba_taxel import InputError
from mitsuba_taxel.surrogates import ContactModel, FrictionPads, read_contact_model, write_contact_model
from mitsuba_taxel.surrogates.contact_readings import NOT_A_NUMBER

pytestmark = pytest.mark.quick

SHEAR, SIDE, COUNT, HEIGHT = 0.7, 0.1, 23, 3.0


def cerruti(x, y, side):
    """Displacements (2, m, 2, m) along x and y of an incompressible half-space of shear modulus 1, per N along x and y
    on each square: V. Cerruti's solution, integrated over rectangles (K. L. Johnson, 1985, eq. 3.83)."""
    a, b, h, poisson = x[:, None] - x, y[:, None] - y, side / 2, 0.5

    def over(part):
        corners = [(a + h, b + h, 1), (a - h, b + h, -1), (a + h, b - h, -1), (a - h, b - h, 1)]
        return sum(sign * part(u, v) for u, v, sign in corners)

    along_x = over(lambda u, v: v * np.arcsinh(u / np.abs(v)))
    along_y = over(lambda u, v: u * np.arcsinh(v / np.abs(u)))
    across = over(lambda u, v: -np.hypot(u, v))
    both = along_x + along_y
    rows = [(1 - poisson) * both + poisson * along_x, poisson * across, (1 - poisson) * both + poisson * along_y]
    matrix = np.array([[rows[0], rows[1]], [rows[1], rows[2]]]) / (2 * np.pi * side**2)
    return matrix.transpose(0, 2, 1, 3)


@cache
def pad(side=SIDE, count=COUNT):
    x, y = grid(count, side)
    y = y[::-1]  # rows from +y to -y
    edges = np.unique(x)
    return ContactModel(
        x=edges,
        y=edges[::-1],
        size=(side, side),
        height=HEIGHT,
        covered=np.ones((count, count), dtype=bool),
        compliance=half_space(x, y, side) / (4 * SHEAR),  # plane-strain modulus of an incompressible solid
        rest=np.array([4e-3]),
        gradient=np.full((1, count**2), 1e-3),
        largest_depth=1.0,
        places=np.array([[-5.0, -5.0], [5.0, 5.0]]),
        lateral=np.zeros((2, count**2, count**2)),
        tangential=cerruti(x, y, side) / SHEAR,
        tangential_gradient=np.stack([np.full((1, count**2), 2e-4), np.full((1, count**2), -3e-4)], axis=1),
    )


def ball(model, radius, depth, place=(0.0, 0.0)):
    return (depth - ((model.points[..., :2] - place) ** 2).sum(axis=-1) / (2 * radius))[None]


def mindlin(slide, force, contact, friction):
    """Tangential force of a ball that moves by ``slide`` along the surface, and the radius of the part that sticks."""
    most = 3 * friction * force * 1.5 / (16 * SHEAR * contact)
    stuck = contact * np.sqrt(max(1 - abs(slide) / most, 0.0))
    return np.sign(slide) * friction * force * (1 - (stuck / contact) ** 3), stuck


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, -1.0), (0.6, 0.8)])
@pytest.mark.parametrize(("radius", "depth", "friction"), [(6.0, 0.15, 0.4), (3.0, 0.25, 1.1)])
def test_a_ball_sticks_and_slides_as_cattaneo_and_mindlin_say(radius, depth, friction, direction):
    model, contact = pad(), np.sqrt(radius * depth)
    force, direction = 16 / 3 * SHEAR * radius**0.5 * depth**1.5, np.array(direction)
    most = 3 * friction * force * 1.5 / (16 * SHEAR * contact)
    pads = FrictionPads(model, 1, friction)
    slid = 0.0
    for fraction in (0.2, 0.5, 0.8, 1.3):
        place = fraction * most * direction
        found = pads.step(ball(model, radius, depth, place), (fraction * most - slid) * direction[None])
        slid = fraction * most
        expected, stuck = mindlin(slid, force, contact, friction)
        assert found.readings.force[0, :2] @ direction == pytest.approx(expected, rel=0.01)
        assert abs(found.readings.force[0, :2] @ [-direction[1], direction[0]]) < 0.01 * expected
        assert found.readings.force[0, 2] == pytest.approx(-force, rel=0.01)
        assert np.hypot(*(found.readings.centre[0] - place)) < 0.2 * fraction * most  # pressures of undeformed patches
        held = np.count_nonzero(found.traction[0].any(axis=0) & ~found.sliding[0]) * SIDE**2
        assert held == pytest.approx(np.pi * stuck**2, abs=np.pi * contact * SIDE)
        # Back: half of the loop is twice the first branch at half of the way (Masing; R. D. Mindlin, 1953).
    pads.reset()
    pads.step(ball(model, radius, depth, 0.6 * most * direction), 0.6 * most * direction[None])
    for back, way in ((0.3, 0.3), (0.9, 0.6)):
        place = (0.6 - back) * most * direction
        found = pads.step(ball(model, radius, depth, place), -way * most * direction[None])
        there, half = (mindlin(part * most, force, contact, friction)[0] for part in (0.6, back / 2))
        branch = there - 2 * half
        assert found.readings.force[0, :2] @ direction == pytest.approx(branch, abs=0.005 * friction * force)


@pytest.mark.parametrize("contact", [0.65, 0.95])
def test_a_turned_punch_that_sticks_follows_reissner_and_sagoci(contact):
    """Moment 16/3 G a³ per angle; E. Reissner and H. F. Sagoci, J. Appl. Phys. 15 (1944)."""
    model, angle, found = pad(), 1e-3, []
    x, y = model.points[..., 0], model.points[..., 1]
    flat = np.where(np.hypot(x, y) < contact, 0.1, -1.0)
    # A flat punch of squares has the radius of a circle of the same area.
    radius = np.sqrt(np.count_nonzero(flat > 0) * SIDE**2 / np.pi)
    turned = angle * np.stack([-y, x])[None]
    found = FrictionPads(model, 1, 1e3).step(flat[None], turned)
    assert found.readings.moment[0, 2] == pytest.approx(16 / 3 * SHEAR * radius**3 * angle, rel=0.06)
    assert np.abs(found.readings.force[0, :2]).max() < 1e-9 and not found.sliding.any()


def test_conditions_of_friction_hold_on_paths_of_random_bodies():
    model, rng, count, friction = pad(0.3, 9), np.random.default_rng(3), 40, 0.5
    pads, area = FrictionPads(model, count, friction), model.size[0] * model.size[1]
    compliance = model.tangential.reshape(162, 162)
    moved = np.zeros((count, 2, 81))
    for _ in range(4):
        radius, depth = rng.uniform(2, 6, (count, 1, 1)), rng.uniform(0.1, 0.4, (count, 1, 1))
        depths = depth - (model.points[..., :2] ** 2).sum(axis=-1) / (2 * radius)
        slip = 0.1 * rng.normal(size=(count, 2))
        found = pads.step(depths, slip)
        forces = found.traction.reshape(count, 2, 81) * area
        limit = friction * found.readings.pressure.reshape(count, 81) * area
        length = np.hypot(forces[:, 0], forces[:, 1])
        assert (length <= limit * (1 + 1e-7) + 1e-12).all()
        own = (forces.reshape(count, -1) @ compliance).reshape(forces.shape)
        gap = moved + slip[..., None] - own  # of the body over the pad
        inside = length < 0.999 * limit
        assert inside.any() and np.abs(gap.transpose(0, 2, 1)[inside]).max() < 1e-6
        slides = (limit > 0) & ~inside
        along = (gap * forces).sum(axis=1)[slides], (np.hypot(gap[:, 0], gap[:, 1]) * length)[slides]
        assert slides.any() and np.abs(along[0] - along[1]).max() < 1e-6 * limit.max()
        moved = own


def test_readings_and_moments_follow_the_tangential_forces():
    """Under flat punches, whose normal forces do not change while the top is dragged along."""
    model = pad()
    pads, squares = FrictionPads(model, 2, 0.3), ((model.points[..., :2] - [0.2, -0.1]) ** 2).sum(axis=-1)
    depth = np.where(squares < 0.5, np.array([0.2, 0.1])[:, None, None], -1.0)
    far = 1e3 * np.eye(2)  # all slides, straight along x and y
    without, step = model(depth), pads.step(depth, far)
    found, normal = step.readings, -without.force[:, 2]
    np.testing.assert_allclose(found.force[:, :2], 0.3 * np.diag(normal), atol=1e-6 * normal.max())
    changes = [[0.3 * normal[0] * 2e-4], [-0.3 * normal[1] * 3e-4]]
    np.testing.assert_allclose(found.power - without.power, changes, rtol=1e-5)
    # Forces act at the displaced points of the top, at the depth of the body.
    area = model.size[0] * model.size[1]
    moves = np.einsum("ambn,kbn->kam", model.tangential, step.traction.reshape(2, 2, -1) * area)
    own = np.concatenate([step.traction.reshape(2, 2, -1), -without.pressure.reshape(2, 1, -1)], axis=1) * area
    points = np.broadcast_to(model.points.reshape(-1, 3).T, own.shape) + 0.0
    points[:, :2] += moves
    points[:, 2] -= np.maximum(depth.reshape(2, -1), 0)
    expected = np.cross(points, own, axis=1).sum(axis=2)
    np.testing.assert_allclose(found.moment, expected, rtol=1e-6, atol=1e-9)
    centres = (points[:, :2] * own[:, 2:]).sum(axis=2) / own[:, 2].sum(axis=1)[:, None]
    np.testing.assert_allclose(found.centre, centres, rtol=1e-9)
    # Without friction nothing changes.
    frictionless = FrictionPads(model, 2, 0.0).step(depth, far)
    smooth = frictionless.readings
    np.testing.assert_array_equal(frictionless.sliding, without.pressure > 0)
    np.testing.assert_array_equal(smooth.power, without.power)
    np.testing.assert_array_equal(smooth.moment, without.moment)


def test_a_top_that_is_dragged_along_meets_the_same_part_of_the_body():
    """A ball that moves without sliding presses like one that did not move, on patches that moved with it."""
    model = pad()
    for radius, depth, place in ((3.0, 0.2, (0.11, -0.06)), (6.0, 0.1, (0.05, 0.14))):
        pads, still = FrictionPads(model, 1, 50.0), model(ball(model, radius, depth))
        pads.step(ball(model, radius, depth), np.zeros((1, 2)))
        moved = pads.step(ball(model, radius, depth, place), np.array([place])).readings
        slid = model(ball(model, radius, depth, place))
        off, without = (np.abs(other.pressure - still.pressure).max() for other in (moved, slid))
        assert off < 0.4 * without and without > 0.5 * still.pressure.max()
        assert moved.force[0, 2] == pytest.approx(still.force[0, 2], rel=0.005)


def test_pads_with_nan_are_flagged_and_stay_as_they_were():
    model = pad(0.3, 9)
    pads, alone = FrictionPads(model, 3, 0.5), FrictionPads(model, 1, 0.5)
    depth = np.repeat(ball(model, 4.0, 0.2), 3, axis=0)
    pads.step(depth, np.full((3, 2), 0.02))
    alone.step(depth[:1], np.full((1, 2), 0.02))
    bad, slip = depth.copy(), np.full((3, 2), 0.03)
    bad[1, 0, 0], slip[2, 1] = np.nan, np.nan
    found = pads.step(bad, slip).readings
    assert found.status.tolist() == [0, NOT_A_NUMBER, NOT_A_NUMBER] and np.isnan(found.power[1:]).all()
    for values in (found.force, found.moment, found.area, found.pressure):
        assert np.isnan(values[1:]).all() and np.isfinite(values[0]).all()
    back = pads.step(depth, np.full((3, 2), -0.01)).readings
    once = alone.step(depth[:1], np.full((1, 2), -0.01)).readings
    np.testing.assert_allclose(back.force[1:], np.repeat(once.force, 2, axis=0), rtol=1e-6)
    assert not np.allclose(back.force[0], once.force[0])
    pads.reset([0, 2])
    fresh = FrictionPads(model, 1, 0.5).step(depth[:1], np.full((1, 2), 0.01)).readings
    np.testing.assert_allclose(pads.step(depth, np.full((3, 2), 0.01)).readings.force[2], fresh.force[0], rtol=1e-6)


def test_files_keep_friction(tmp_path):
    model = pad(0.3, 9)
    write_contact_model(model, tmp_path / "pad.npz")
    again = read_contact_model(tmp_path / "pad.npz")
    for name in ("tangential", "tangential_gradient"):
        np.testing.assert_array_equal(getattr(again, name), getattr(model, name))
    write_contact_model(replace(model, tangential=None, tangential_gradient=None), tmp_path / "plain.npz")
    assert read_contact_model(tmp_path / "plain.npz").tangential is None


def test_what_friction_refuses():
    model = pad(0.3, 9)
    with pytest.raises(InputError, match="no friction: make it by contact_model or export_contact, friction=True"):
        FrictionPads(replace(model, tangential=None), 1, 0.5)
    for friction in (-0.1, np.nan, "rough"):
        with pytest.raises(InputError, match="friction = .* at least 0"):
            FrictionPads(model, 1, friction)
    for pads in (0, 1.5):
        with pytest.raises(InputError, match="pads = .* whole number above 0"):
            FrictionPads(model, pads, 0.5)
    pads = FrictionPads(model, 2, 0.5)
    for slip in (np.zeros(2), np.zeros((1, 2)), np.zeros((2, 2, 3, 3)), "fast"):
        with pytest.raises(InputError, match="slip .* is not allowed"):
            pads.step(np.repeat(ball(model, 4.0, 0.2), 2, axis=0), slip)
    for depth in (ball(model, 4.0, 0.2), np.zeros((2, 9, 8)), np.zeros(2)):
        with pytest.raises(InputError, match=r"^depth of shape .* is needed, with as many maps of depth as pads\.$"):
            pads.step(depth, np.zeros((2, 2)))
