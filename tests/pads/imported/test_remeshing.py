"""Surfaces made of even triangles are the surfaces that they were."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mitsuba_taxel.geometry.element_maps import curved_volume
from mitsuba_taxel.geometry.surfaces.triangles import closest_on_triangles, half_edges, near, volume
from mitsuba_taxel.pads.imported.triangles.remeshing import remeshed
from mitsuba_taxel.pads.imported.triangles.repair import repaired
from mitsuba_taxel.pads.imported.triangles.snapping import Patches
from mitsuba_taxel.pads.pad_file import PadFile


def quality(corners):
    a, b, c = (corners[:, k] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return 4 * np.sqrt(3) * area / ((b - a) ** 2 + (c - b) ** 2 + (a - c) ** 2).sum(axis=1)


@pytest.mark.parametrize(
    ("shape", "size", "planar"),
    [
        (trimesh.creation.box((4, 3, 2)), 0.7, True),  # far larger triangles
        (trimesh.creation.cylinder(2.0, 3.0, sections=64), 0.8, False),  # fans and long strips
        (trimesh.creation.icosphere(4, 2.0), 0.9, False),  # far smaller ones
        (trimesh.creation.annulus(1.0, 2.0, 3.0, sections=48), 0.5, False),  # a hole through it
    ],
    ids=["box", "cylinder", "sphere", "annulus"],
)
def test_triangles_are_even_of_the_size_asked_for_and_on_the_surface(shape, size, planar):
    vertices, triangles = repaired(np.array(shape.vertices), np.array(shape.faces))
    nothing = np.zeros(len(triangles), dtype=int)
    patches = Patches(vertices, triangles, nothing, nothing)
    points, faces, patch = remeshed(patches, lambda points, _: np.full(len(points), size))
    ends, count = np.unique(np.sort(half_edges(faces)[0], axis=1), axis=0, return_counts=True)
    assert np.all(count == 2)
    assert len(points) - len(ends) + len(faces) == shape.euler_number
    assert quality(points[faces]).min() > 0.4
    length = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    assert 0.6 * size < np.median(length) < 1.2 * size and length.max() < 1.8 * size
    assert len(np.unique(patch)) == patches.count
    point, triangle = near(points, vertices[triangles], 1e-6)
    off = np.linalg.norm(closest_on_triangles(points[point], vertices[triangles[triangle]]) - points[point], axis=1)
    assert len(np.unique(point[off < 1e-6])) == len(points)
    if planar:
        assert volume(points, faces) == pytest.approx(volume(vertices, triangles), rel=1e-12)


def test_borders_of_regions_stay_where_they_are():
    """Two regions meet on the flat top of a box along a line with a kink."""
    corners = np.array([(0, 0), (2, 0), (4, 0), (0, 4), (1, 4), (4, 4), (3, 2)], dtype=float)
    top = np.array([(0, 1, 6), (0, 6, 3), (3, 6, 4), (1, 2, 6), (2, 5, 6), (5, 4, 6)])
    vertices = np.concatenate([np.insert(corners, 2, 2.0, axis=1), np.insert(corners[:6], 2, 0.0, axis=1)])
    rim = [0, 1, 2, 5, 4, 3]
    wall = [[(k + 7, m + 7, m), (k + 7, m, k)] for k, m in zip(rim, rim[1:] + rim[:1], strict=True)]
    bottom = [(7, 10, 8), (8, 10, 11), (8, 11, 9), (9, 11, 12)]
    triangles = np.array([*top, *(t for pair in wall for t in pair), *bottom])
    region = np.zeros(len(triangles), dtype=int)
    region[:3] = 1
    patches = Patches(vertices, triangles, region, 0 * region)
    points, faces, patch = remeshed(patches, lambda points, _: np.full(len(points), 0.5))
    area = 0.5 * np.linalg.norm(np.cross(*(points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2))), axis=1)
    assert area[patch == patches.patch[0]].sum() == pytest.approx(9.0, rel=1e-12)
    assert area[patch == patches.patch[3]].sum() == pytest.approx(7.0, rel=1e-12)


@pytest.mark.parametrize("mesh_size", [20.0, 200.0])
def test_elements_larger_than_the_pad_leave_its_corners(box, write_stl, tmp_path, mesh_size):
    mesh = PadFile(write_stl(tmp_path / "box.stl", box((6, 5, 4), (2.4, 2.2, 1.8)))).mesh(mesh_size)
    assert curved_volume(mesh) == pytest.approx(6 * 5 * 4 - 2.4 * 2.2 * 1.8, rel=1e-9)
