"""Mirrors of surfaces and the part that they complete."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS
from mitsuba_taxel.geometry.surfaces.polygons import NotSimple, triangulated
from mitsuba_taxel.geometry.surfaces.triangles import half_edges, subdivided, volume
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.pads import PadFile, Rule
from mitsuba_taxel.pads.imported.regions import FacedSurface, tagged
from mitsuba_taxel.pads.imported.symmetric_part import mirrors_of, planes_of, symmetric_part_of
from mitsuba_taxel.pads.imported.triangles.repair import faces_of, repaired
from mitsuba_taxel.pads.pad_file import mesh_pad_file


def surface(corners):
    return repaired(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def turned(corners, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return corners @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def pinwheel(box):
    """A square block whose square hollow is turned by 20 degrees: as heavy on all sides, and without a mirror."""
    corners = box((4.0, 4.0, 3.0), (1.5, 1.5, 1.0))
    inner = np.abs(corners[:, :, :2]).max(axis=2) < 1
    return np.where(inner[:, :, None], turned(corners, 20), corners)


@pytest.mark.parametrize(
    ("shape", "mirrors"),
    [
        (lambda box: box(), MIRRORS),
        (lambda box: box((5.0, 4.0, 3.0)), (ACROSS_X, ACROSS_Y)),
        (lambda box: box() + (0.5, 0, 0), (ACROSS_Y,)),
        (lambda box: box() + (0.5, 0.3, 0), ()),
        (lambda box: turned(box((5.0, 4.0, 3.0)), 45), MIRRORS[2:]),
        (lambda box: turned(box(), 10), ()),
        (pinwheel, ()),
        (lambda box: box() + 1e-3 * (box() == 2), (ACROSS_DIAGONAL,)),
    ],
)
def test_mirrors_are_found_and_the_part_between_them_is_closed(box, shape, mirrors):
    vertices, triangles = surface(shape(box))
    found = mirrors_of(vertices, triangles, np.zeros(len(triangles)))
    assert set(found) == set(mirrors)
    points, part, origin = symmetric_part_of(vertices, triangles, planes_of(found))
    _, count = np.unique(np.sort(half_edges(part)[0], axis=1), axis=0, return_counts=True)
    assert np.all(count == 2)
    copies = {0: 1, 1: 2, 2: 4, 4: 8}[len(found)]
    assert copies * volume(points, part) == pytest.approx(volume(vertices, triangles), rel=1e-12)
    assert (origin < 0).any() == bool(mirrors)


def test_a_surface_may_be_off_its_image_by_the_chords_of_its_curves(box):
    shape = box()
    for off, mirrors in ((2e-4, MIRRORS), (5e-4, (ACROSS_DIAGONAL,))):
        vertices, triangles = surface(shape + off * (shape == 2))
        assert set(mirrors_of(vertices, triangles, np.zeros(len(triangles)))) == set(mirrors)


def test_a_few_vertices_may_have_images_beside_their_region(box):
    """Seams on curved walls follow triangles, which are not symmetric."""
    vertices, triangles = surface(box())
    for _ in range(4):
        edges, number = np.unique(np.sort(half_edges(triangles)[0], axis=1), axis=0, return_inverse=True)
        middle = len(vertices) + number.reshape(-1, 3)
        vertices = np.concatenate([vertices, vertices[edges].mean(axis=1)])
        triangles, _ = subdivided(vertices, triangles, middle)
    height = vertices[triangles][:, :, 2].mean(axis=1)
    above = np.argsort(height)[np.count_nonzero(height < 1.5) :]
    for count, mirrors in ((1, MIRRORS), (40, ())):
        region = np.where(height < 1.5, 1, 2)
        region[above[:count]] = 1
        assert mirrors_of(vertices, triangles, region) == mirrors


def test_a_region_that_lies_on_one_side_breaks_the_symmetry(box):
    vertices, triangles = surface(box())
    faced = FacedSurface(vertices, triangles, faces_of(vertices, triangles))
    assert mirrors_of(vertices, triangles, tagged(faced, ())[0]) == MIRRORS
    region, _ = tagged(faced, [Rule("top", normal=(1, 0, 0), within=10, box=((1.9, -9, 0), (9, 9, 9)))])
    assert mirrors_of(vertices, triangles, region) == (ACROSS_Y,)


def test_the_mesh_of_a_symmetric_file_is_symmetric_to_the_bit(box, write_stl, tmp_path):
    for shape, mirrors in ((box(), MIRRORS), (box() + (0.5, 0, 0), (ACROSS_Y,)), (pinwheel(box), ())):
        mesh = mesh_pad_file(PadFile(write_stl(tmp_path / "box.stl", shape)), 1.5)
        assert tuple(node_images(mesh)) == mirrors


def polygon(corners, start, step=1):
    numbers = start + np.arange(corners)[::step]
    return np.stack([numbers, np.roll(numbers, -1)], axis=1)


def test_polygons_with_holes_are_covered_once():
    """A square with points along its sides and two round holes, and another square in one of these."""
    angle = 2 * np.pi * np.arange(16) / 16
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    side = np.arange(5) / 5
    square = np.concatenate([np.stack(c, axis=1) for c in ((side, 0 * side), (1 + 0 * side, side))])
    square = 10 * (np.concatenate([square, 1 - square]) - 0.5)
    points = np.concatenate([square, 1.5 * ring - (2, 0), 2 * ring + (2, 1), 0.5 * square / 5 + (2, 1)])
    edges = [polygon(20, 0), polygon(16, 20, -1), polygon(16, 36, -1), polygon(20, 52)]
    triangles = triangulated(points, np.concatenate(edges))
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    circle = 8 * math.sin(2 * math.pi / 16)
    assert area.min() > 0
    assert area.sum() == pytest.approx(100 - (1.5**2 + 2**2) * circle + 1)
    ends = half_edges(triangles)[0]
    inner = (ends[:, None] == ends[None, :, ::-1]).all(axis=2).any(axis=1)
    np.testing.assert_array_equal(np.unique(ends[~inner], axis=0), np.unique(np.concatenate(edges), axis=0))


def test_edges_that_are_no_polygon_are_refused():
    with pytest.raises(NotSimple):
        triangulated(np.random.default_rng(1).normal(size=(4, 2)), np.array([(0, 1), (1, 2), (2, 3)]))
    with pytest.raises(NotSimple):
        triangulated(np.array([(0, 0), (1, 1), (1, 0), (0, 1)], dtype=float), polygon(4, 0))
