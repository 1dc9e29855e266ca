"""The strip beside singular edges, in which a pad may fold, and corners of the rims of a pad."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.bezier_patches import first_touch
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES
from mitsuba_taxel.mechanics import NeoHookean, load_path
from mitsuba_taxel.mechanics.contact.barriers.singular_edges import (
    STRIP,
    beyond_strip,
    has_right_angled_top,
    judged_nodes,
    rim_corners,
)
from mitsuba_taxel.pads import REGIONS, Pad
from mitsuba_taxel.pads.parametric.meshing import mesh_pad


def test_distances_from_the_edges_of_a_square_cell():
    """Walls and roofs meet at a right angle of air, as do walls; outside, only the glued rim is singular."""
    pad = Pad(rows=1, columns=1)
    mesh, half = mesh_pad(pad, 2.0), pad.cell_size / 2
    width = STRIP * pad.height
    found = beyond_strip(mesh) + width
    for region in ("side", "roof"):
        nodes = np.unique(mesh.faces[mesh.face_region == REGIONS[region]])
        x, y, z = np.abs(mesh.points[nodes]).T
        to_walls = np.sort([half - x, half - y], axis=0)
        expected = np.hypot(*to_walls) if region == "side" else to_walls[0]
        if region == "side":
            expected = np.min([expected, z, pad.top_of_cell - z], axis=0)
        np.testing.assert_allclose(found[nodes], expected, atol=1e-9)
    top = mesh.points[:, 2] == pad.height
    assert (found[top] > pad.height - pad.top_of_cell - 1e-9).all()


def test_elements_must_not_be_inverted_where_light_meets_them_beyond_the_strip():
    pad = Pad(rows=1, columns=1)
    mesh, half, width = mesh_pad(pad, 2.0), pad.cell_size / 2, STRIP * pad.height
    x, y, z = np.abs(mesh.points).T
    to_wall, to_other = np.sort([half - x, half - y], axis=0)
    on_wall = np.isclose(to_wall, 0) & (np.min([to_other, z, pad.top_of_cell - z], axis=0) > width)
    on_roof = np.isclose(z, pad.top_of_cell) & (to_wall > width)
    np.testing.assert_array_equal(judged_nodes(mesh), on_wall | on_roof)


@pytest.mark.parametrize(("border", "touch"), [(-1.0, True), (0.25, True), (0.75, False), (2.0, False)])
def test_patches_may_touch_within_the_strip(border, touch):
    """A curved triangle is cut by another at x = 0.5; both may touch, and anything may, where x < ``border``."""
    plane = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    other = np.array([[0.5, -1, -1], [0.5, 2, -1], [0.5, 0, 2]])
    pair = []
    for corners, bulge in ((plane, 0.1), (other, 0.0)):
        middles = [(corners[i] + corners[j]) / 2 + (0, 0, bulge) for i, j in FACE_EDGES]
        points = np.concatenate([corners, middles])
        pair.append(np.column_stack([points, points[:, 0] - border]).T[:, :, None])
    found = first_touch(*pair, "nothing", 1e-10)
    assert (found is not None) == touch


def test_the_first_touch_does_not_depend_on_the_mesh():
    """That of roof and wall, whose crease begins at their edge under any load; 3.27 N on elements of 0.8 mm."""
    ends = []
    for mesh_size in (1.6, 1.25):
        with pytest.raises(ComputationError, match="touches itself") as caught:
            load_path(Pad(rows=1, columns=1), NeoHookean(), [(9, 0, 0)], mesh_size=mesh_size)
        ends.append(float(re.search(r"force = \(([\d.]+), 0, 0\)", str(caught.value))[1]))
    assert ends == pytest.approx([3.27, 3.27], rel=0.04)


@pytest.fixture(scope="module")
def box():
    return Pad(rows=1, columns=2).mesh(2.5)


@pytest.mark.parametrize("region", ["bottom", "top"])
def test_the_rim_of_a_box_has_four_corners(box, region):
    x, y, height = box.points.max(axis=0)
    found = box.points[rim_corners(box, region, 85.0)]
    at = height if region == "top" else 0.0
    np.testing.assert_allclose(np.unique(found, axis=0), [(i * x, j * y, at) for i in (-1, 1) for j in (-1, 1)])
    assert not len(rim_corners(box, region, 95.0))


def test_a_top_whose_sides_lean_or_meet_in_a_blunt_angle_has_none_that_is_right_angled(box):
    assert has_right_angled_top(box)
    x, y, z = box.points.T
    leaning = np.stack([x * (1 - 0.2 * z / z.max()), y * (1 - 0.2 * z / z.max()), z], axis=1)
    sheared = np.stack([x + 0.5 * y, y, z], axis=1)  # two corners of 63 and two of 117 degrees
    moved = [replace(box, points=points) for points in (leaning, sheared)]
    assert [has_right_angled_top(one) for one in moved] == [False, True]
    assert len(rim_corners(moved[1], "top", 85.0)) == 2
