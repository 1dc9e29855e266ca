"""Faces of a box: their views from points against closed forms, and their areas by counting."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mitsuba_taxel.transport.box import Box
from mitsuba_taxel.transport.box_faces import around, faces_of
from mitsuba_taxel.transport.exchange import Exchange, Starts
from mitsuba_taxel.transport.patches import PatchPoints
from mitsuba_taxel.transport.pieces import cut_near
from mitsuba_taxel.transport.rules import triangle_rule

TURN = Rotation.from_euler("xyz", [20, -10, 40], degrees=True).as_matrix()
BOX = Box(np.array([0.3, -0.2, 0.1]), TURN, np.array([0.8, 0.5, 0.3]))
OPENINGS = (-0.6, -0.3, -0.2, 0.1), (0.2, 0.7, -0.1, 0.4)
POINTS = np.array([[0.2, 0.1, 1.5], [2.0, 0.4, 0.9], [-1.5, -1.2, 0.6], [0.4, -2.0, 1.4]])


def view_of(polygon, at, normal):
    """Share of a Lambertian source's light on a polygon in front of it. Source: J. H. Lambert, Photometria, 1760."""
    rays = polygon - at
    if np.cross(rays[1] - rays[0], rays[2] - rays[0]) @ rays[0] >= 0:
        return 0.0
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    total = 0.0
    for one, other in zip(rays, np.roll(rays, -1, axis=0), strict=True):
        across = np.cross(other, one)
        total += np.arccos(one @ other) * (across @ normal) / np.linalg.norm(across)
    return total / (2 * np.pi)


def views(places, at, normal):
    """(G,) the same of patches, by quadrature of degree 4 on small pieces."""
    rule, weights = triangle_rule(2)
    total = np.zeros(len(places))
    start = Starts(at[None], normal[None], np.zeros(1), np.ones(1))
    for _, which, pieces in cut_near(at[None], places, None, 6.0):
        if not len(which):
            continue
        face = np.repeat(pieces.face[which], len(rule))
        order = np.argsort(face, kind="stable")
        where = pieces.points(rule)[which].reshape(-1, 2)[order]
        weight = np.outer(pieces.areas()[which], weights).ravel()[order]
        placed = PatchPoints(face[order], where).positions_and_areas(places)
        light = Exchange(start, *placed, np.zeros_like(face), np.arange(len(face))).values()
        total += np.bincount(face[order], weight * light, len(places))
    return total


def corners(x, y):
    """(4, 3) of a rectangle on the top, anticlockwise from above."""
    return np.array([(x[0], y[0], 0.3), (x[1], y[0], 0.3), (x[1], y[1], 0.3), (x[0], y[1], 0.3)])


def in_world(points):
    return points @ BOX.axes + BOX.centre


@pytest.mark.parametrize("at", POINTS)
def test_faces_and_openings_are_seen_as_the_rectangles_that_they_cover(at):
    """From each of a few points, looking at the box from outside."""
    at, normal = in_world(at), -(at @ BOX.axes) / np.linalg.norm(at)
    faces = faces_of(BOX, OPENINGS)
    cuts = faces.cuts(0.9)
    kind = np.repeat(faces.kind, 2 * cuts.prod(axis=1))
    found = np.bincount(kind + 1, views(faces.positions(cuts), at, normal), 3)
    x, y, z = BOX.half
    sides = [
        np.array([(-x, -y, -z), (x, -y, -z), (x, -y, z), (-x, -y, z)]),
        np.array([(x, -y, -z), (x, y, -z), (x, y, z), (x, -y, z)]),
    ]
    sides += [each * (-1, -1, 1) for each in sides]
    openings = [view_of(in_world(corners(each[:2], each[2:])), at, normal) for each in OPENINGS]
    top = view_of(in_world(corners((-x, x), (-y, y))), at, normal)
    rest = sum(view_of(in_world(each), at, normal) for each in sides)
    assert found == pytest.approx([top + rest - sum(openings), *openings], rel=1e-6)


INTERVALS = st.tuples(st.integers(-2, 12), st.integers(1, 6))


@given(st.lists(st.tuples(INTERVALS, INTERVALS), max_size=4))
def test_a_rectangle_is_covered_once_but_for_its_openings(openings):
    """Openings that overlap, touch, or reach beyond an edge; counted on a lattice."""
    rectangles = [(float(x), float(x + a), float(y), float(y + b)) for (x, a), (y, b) in openings]
    x, y = np.meshgrid(np.arange(10) + 0.5, np.arange(8) + 0.5)
    count = sum(
        ((a < x) & (x < b) & (c < y) & (y < d) for a, b, c, d in around((0.0, 10.0, 0.0, 8.0), rectangles)),
        start=np.zeros(x.shape, dtype=int),
    )
    open_ = np.zeros(x.shape, dtype=bool)
    for a, b, c, d in rectangles:
        open_ |= (a < x) & (x < b) & (c < y) & (y < d)
    np.testing.assert_array_equal(count, ~open_)


def test_patches_are_not_large_and_slivers_of_rounding_are_left_out():
    faces = faces_of(BOX, [(-0.8 + 1e-9, -0.3, -0.5, 0.5)])
    lengths = np.linalg.norm(faces.sides, axis=2) / faces.cuts(0.9)
    assert lengths.min() > 0.1 and lengths.max() <= 0.9
