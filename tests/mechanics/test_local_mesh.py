"""Meshes that are refined where an indenter goes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import ACROSS_Y
from mitsuba_taxel.mechanics import local_mesh
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.local_mesh import SMALL_DEPTH, Refinement, mesh_under, swept_legs
from mitsuba_taxel.pads import REGIONS, Pad

BLOCK = Pad("parallelepiped", 1, 1, cell_size=0.4, cell_height=0.4, height=2.0, wall=1.3)
MESH, BALL = BLOCK.mesh(0.8), Indenter("sphere", radius=1.0)
REACH = BALL.body.contact_radius(SMALL_DEPTH * BLOCK.height)


def largest_under(mesh, x, y=0.0):
    """Longest side of the faces of the top near a place, relative to half the width of the contact."""
    top = mesh.points[mesh.faces[mesh.face_region == REGIONS["top"]][:, :3]]
    longest = np.linalg.norm(top - np.roll(top, 1, axis=1), axis=2).max(axis=1)
    near = np.linalg.norm(top.mean(axis=1)[:, :2] - [x, y], axis=1) < 0.7 * REACH
    return longest[near].max() / REACH


def test_elements_are_small_all_along_a_leg_and_large_elsewhere():
    mesh = mesh_under(MESH, BALL, Refinement(legs=(((0.0, 0.0), (1.0, 0.0)),)))
    assert all(largest_under(mesh, x) < 0.9 for x in np.linspace(0, 1, 8))
    assert largest_under(mesh, -1.0) > 1.5
    in_place = mesh_under(MESH, BALL, Refinement())
    assert largest_under(in_place, 0.0) < 0.9 < 1.5 < largest_under(in_place, 1.0)
    assert len(mesh.tets) < 4 * len(in_place.tets)
    assert list(node_images(mesh)) == [ACROSS_Y]


def test_elements_are_smaller_around_the_tip_of_a_body_that_is_not_deep():
    usual, finer = (mesh_under(MESH, BALL, Refinement(depth=share * SMALL_DEPTH)) for share in (1.0, 0.25**2))

    def at_tip(mesh):
        top = mesh.points[mesh.faces[mesh.face_region == REGIONS["top"]][:, :3]]
        nearest = np.linalg.norm(top.mean(axis=1)[:, :2], axis=1).argmin()
        return np.linalg.norm(top[nearest] - np.roll(top[nearest], 1, axis=0), axis=1).max()

    assert at_tip(finer) < 0.3 * at_tip(usual)
    assert len(finer.tets) < 1.5 * len(usual.tets)


@pytest.mark.parametrize("turn", [(1, 0), (0, 1), (0.6, -0.8)])
def test_legs_change_seldom_as_a_body_is_dragged_on(turn):
    way = np.outer(np.linspace(0, 4, 41), [*turn, 0]) - [0, 0, 0.1]
    legs = [swept_legs(way[: count + 1].tolist(), 0.5) for count in range(len(way))]
    changes = [count for count in range(1, len(way)) if legs[count] != legs[count - 1]]
    assert [round(0.1 * count, 9) for count in changes] == [0.3, 0.8, 1.3, 2.3]
    for row, found in zip(way, legs, strict=True):  # they are long enough
        (end,) = [np.linalg.norm(leg[1]) for leg in found] or [0.0]
        assert np.linalg.norm(row[:2]) <= end + 0.25 + 1e-9
    assert legs[0] == legs[2] == ()
    np.testing.assert_allclose(legs[-1], [[[0, 0], 4 * np.array(turn)]], atol=1e-9)


def test_legs_cover_ways_back_and_aside_but_none_above_the_pad():
    there = [(0, 0, -0.1), (1, 0, -0.1)]
    back = swept_legs([*there, (0.2, 0, -0.1), (-1, 0, -0.1)], 0.5)
    assert back[0] == ((0.0, 0.0), (1.0, 0.0)) and back[1][1][0] <= -1 and len(back) == 2
    assert swept_legs([*there, (0.2, 0, -0.1)], 0.5) == back[:1]
    aside = swept_legs([*there, (1, 1, -0.1)], 0.5)
    assert aside == (back[0], ((1.0, 0.0), (1.0, 1.0)))
    assert swept_legs([(0, 0, -0.1), (0, 0, 0.1), (3, 0, 0.1)], 0.5) == ()
    assert swept_legs([(0, 0, 0.1), (3, 0, 0.1), (3, 0, -0.1)], 0.5) == (((3.0, 0.0), (3.0, 0.0)),)
    assert swept_legs([(3, 0, 0.1), (3, 0, -0.1), (4, 0, -0.1)], 0.5)[-1] == ((3.0, 0.0), (4.0, 0.0))


def test_bodies_that_need_too_many_elements_are_refused_by_what_makes_them_small(tmp_path, monkeypatch):
    monkeypatch.setattr(local_mesh, "MOST_ELEMENTS", 10)
    file = tmp_path / "ball.stl"
    trimesh.creation.icosphere(2, 1.0).export(file)
    ellipsoid = Indenter("ellipsoid", semi_axis_x=1.0, semi_axis_y=0.5, semi_axis_z=2.0)
    for body, said in (
        (BALL, "indenter_radius = 1 is not allowed"),
        (ellipsoid, "indenter_semi_axis_y = 0.5 is not allowed"),
        (Indenter(file=file), "indenter_file = .*ball.stl is not allowed"),
    ):
        with pytest.raises(InputError, match=said):
            mesh_under(MESH, body, Refinement())
