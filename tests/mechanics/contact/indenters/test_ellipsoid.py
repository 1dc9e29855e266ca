"""Ellipsoids: distances by an independent minimisation, the ball as a special case, and contacts by Hertz's theory."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import elliprd, elliprf

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_SECOND_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS
from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean, load_path
from mitsuba_taxel.mechanics.results.balance import reactions
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.specification.deformable_pad import DeformablePad


def ellipsoid(x, y, z, **about):
    return Indenter("ellipsoid", semi_axis_x=x, semi_axis_y=y, semi_axis_z=z, **about)


@pytest.mark.parametrize("axes", [(3.0, 1.5, 1.0), (0.7, 0.8, 2.0)])
def test_the_distance_is_the_least_to_any_point_of_the_surface(axes):
    points = np.random.default_rng(4).uniform([-2, -2, -1], [2, 2, 0.3], (12, 3))
    found = ellipsoid(*axes).body.gap(points).size
    for point, distance in zip(points - [0, 0, axes[2]], found, strict=True):

        def apart(angles, point=point):
            (u, v) = angles
            surface = np.array(axes) * [np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)]
            return ((surface - point) ** 2).sum()

        starts = [(np.arctan2(point[1], point[0]) + turn, v) for turn in (0, 1, -1) for v in (-1.2, -0.6, 0.0)]
        least = min(minimize(apart, start, tol=1e-12).fun for start in starts)
        inside = ((point / axes) ** 2).sum() < 1
        assert distance == pytest.approx(-np.sqrt(least) if inside else np.sqrt(least), abs=1e-6)


def test_points_of_the_surface_are_at_no_distance_with_the_normal_of_the_quadric():
    axes = np.array([500.0, 2.0, 1.0])
    ways = np.random.default_rng(5).normal(size=(200, 3))
    surface = axes * ways / np.linalg.norm(ways, axis=1)[:, None]
    gap = ellipsoid(*axes).body.gap(surface + [0, 0, 1.0])
    normal = surface / axes**2
    np.testing.assert_allclose(gap.size, 0, atol=1e-12)
    np.testing.assert_allclose(gap.normal, normal / np.linalg.norm(normal, axis=1)[:, None], atol=1e-11)


@pytest.mark.parametrize("radius", [0.5, 20.0, 500.0])
def test_with_equal_axes_it_is_a_ball(radius):
    ball, body = Indenter("sphere", radius=radius).body, ellipsoid(radius, radius, radius).body
    points = np.random.default_rng(6).uniform([-1, -1, -0.5], [1, 1, 0.2], (200, 3))
    for own, other in zip(body.gap(points), ball.gap(points), strict=True):
        np.testing.assert_allclose(own, other, rtol=1e-9, atol=1e-12)
    assert [body.keeps(mirror) for mirror in MIRRORS] == [True] * len(MIRRORS)
    for depth in (1e-3, 0.02, 10.0):
        assert body.contact_radius(depth) == pytest.approx(ball.contact_radius(depth), rel=1e-12)
        apart = (one.distance_to_steepest_pressure(points, depth) for one in (body, ball))
        np.testing.assert_allclose(*apart, rtol=1e-12)
    assert body.thickness == ball.thickness


@pytest.mark.parametrize("axes", [(3.0, 1.5, 1.0), (1.0, 1.000_01, 1.0), (200.0, 2.0, 1.0), (1.0, 1.000_000_1, 1.0)])
def test_contacts_are_as_wide_as_the_potential_of_a_half_ellipsoid_of_pressure_needs(axes):
    """Inside the contact, the surface sinks by an integral of 1 - x²/(a² + w) - y²/(b² + w), which the depth and the
    radii of curvature have to equal (K. L. Johnson, Contact Mechanics, 1985, section 3.5); here by Carlson's forms."""
    depth = 0.01
    larger, smaller = ellipsoid(*axes).body._contact(depth)
    flat, sharp = (extreme(axes[:2]) ** 2 / axes[2] for extreme in (max, min))
    potential = 2 * elliprf(0, larger**2, smaller**2)
    assert elliprd(0, smaller**2, larger**2) * 2 / 3 / potential == pytest.approx(0.5 / flat / depth, rel=3e-6)
    assert elliprd(0, larger**2, smaller**2) * 2 / 3 / potential == pytest.approx(0.5 / sharp / depth, rel=3e-6)


def test_mirrors_that_map_its_axes_onto_themselves():
    def kept(body):
        return [mirror for mirror in MIRRORS if body.body.keeps(mirror)]

    assert kept(ellipsoid(2, 1, 1)) == kept(ellipsoid(2, 1, 1, angle=90)) == [ACROSS_X, ACROSS_Y]
    assert kept(ellipsoid(2, 1, 1, angle=45)) == [ACROSS_SECOND_DIAGONAL, ACROSS_DIAGONAL]
    assert kept(ellipsoid(2, 1, 1, angle=30)) == []
    assert kept(ellipsoid(2, 2, 1, angle=30)) == list(MIRRORS)
    assert kept(ellipsoid(2, 1, 1, at=(0.5, 0.0))) == [ACROSS_Y]


def test_what_it_lacks_is_named():
    with pytest.raises(InputError, match="indenter_semi_axis_y is missing"):
        Indenter("ellipsoid", semi_axis_x=1.0, semi_axis_z=1.0)
    with pytest.raises(InputError, match="indenter_semi_axis_x is not allowed for indenter = 'sphere'|only for 'ellip"):
        Indenter("sphere", radius=1.0, semi_axis_x=1.0)
    with pytest.raises(InputError, match="indenter_radius is not allowed"):
        ellipsoid(1, 1, 1, radius=2.0)


def test_it_presses_on_a_pad_as_the_ball_does_that_it_is():
    pad = Pad("parallelepiped", 1, 1, cell_size=0.4, cell_height=0.4, height=2.0, wall=1.3)
    forces = []
    for body in (Indenter("sphere", radius=2.0), ellipsoid(2.0, 2.0, 2.0)):
        (state,) = load_path(pad, NeoHookean(), [(0, 0, -0.2)], load=IndenterDisplacement(body), mesh_size=1.2)
        forces.append(reactions(state).applied_force[2])
    assert forces[1] == pytest.approx(forces[0], rel=1e-8)


def test_scenes_have_it():
    sizes = {f"indenter_semi_axis_{axis}": size for axis, size in (("x", 2.0), ("y", 3.0), ("z", 1.5))}
    pad = DeformablePad(load="indenter_displacement", displacement=(0, 0, -0.1), indenter="ellipsoid", **sizes)
    load, value = pad.build_load()
    assert load == IndenterDisplacement(ellipsoid(2.0, 3.0, 1.5))
    again = DeformablePad.of(pad.build_pad(), pad.build_material(), load, value, None)
    assert again.build_load() == (load, value)
    with pytest.raises(InputError, match="indenter_semi_axis_z is missing"):
        DeformablePad(
            load="indenter_displacement", indenter="ellipsoid", indenter_semi_axis_x=2, indenter_semi_axis_y=2
        )
