"""Points found in curved elements: against where they were made, a search of all elements, and closed forms."""

from __future__ import annotations

import math
import re
from functools import lru_cache

import numpy as np
import pytest
from scipy.optimize import root

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.element_maps import jacobians
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, TET_EDGES, VolumeMesh
from mitsuba_taxel.mechanics.locate import displacement_at, displacement_gradient_at
from mitsuba_taxel.mechanics.point_locator import POINTS_AT_ONCE, PointLocator
from mitsuba_taxel.pads import REGIONS, Pad, mesh_pad

CURVED = {"size": (2.0, 1.0, 1.5), "cells": (3, 2, 2), "distortion": 0.1, "curvature": 0.04}


@lru_cache
def meshed(cell, mesh_size):
    """A pad of one cell."""
    return mesh_pad(Pad(cell, rows=1, columns=1), mesh_size)


def functions(barycentric, edges):
    """Quadratic shape functions (P, n), written out."""
    corners = [b * (2 * b - 1) for b in barycentric.T]
    return np.stack([*corners, *(4 * barycentric[:, i] * barycentric[:, j] for i, j in edges)], axis=1)


def drawn(mesh, count, seed=1):
    """Elements, reference coordinates and places of random points."""
    rng = np.random.default_rng(seed)
    element, barycentric = rng.integers(len(mesh.tets), size=count), rng.dirichlet(np.ones(4), count)
    place = np.einsum("pa,pai->pi", functions(barycentric, TET_EDGES), mesh.points[mesh.tets[element]])
    return element, barycentric[:, 1:], place


def on_faces(mesh, faces, count, seed=2):
    """Random points of some curved faces."""
    rng = np.random.default_rng(seed)
    chosen, barycentric = faces[rng.integers(len(faces), size=count)], rng.dirichlet(np.ones(3), count)
    return np.einsum("pa,pai->pi", functions(barycentric, FACE_EDGES), mesh.points[chosen])


def quadratic(seed=3):
    """A field u = a + G X + X H X and its gradient."""
    rng = np.random.default_rng(seed)
    a, g, h = rng.normal(size=3), rng.normal(size=(3, 3)), rng.normal(size=(3, 3, 3))
    h = h + np.swapaxes(h, 1, 2)

    def field(x):
        return a + x @ g.T + 0.5 * np.einsum("ijk,pj,pk->pi", h, x, x)

    return field, lambda x: g + np.einsum("ijk,pk->pij", h, x), h


@pytest.mark.parametrize("curvature", [0.0, 0.04, 0.055])
def test_points_are_found_where_they_were_made(block, curvature):
    mesh = block(**{**CURVED, "curvature": curvature})
    assert jacobians(mesh.points, mesh.tets).min() > 0.1
    element, xi, place = drawn(mesh, POINTS_AT_ONCE + 500)
    found = PointLocator(mesh).locate(place)
    np.testing.assert_array_equal(found.element, element)
    np.testing.assert_allclose(found.reference, xi, atol=1e-12)
    assert not found.offset.any()


def test_a_search_of_all_elements_finds_the_same(block):
    mesh = block(**CURVED)
    points = np.random.default_rng(4).uniform(0, 1, (25, 3)) * CURVED["size"]
    found = PointLocator(mesh).locate(points)

    for point, element, reference in zip(points, found.element, found.reference, strict=True):
        holding = {}
        for number, nodes in enumerate(mesh.points[mesh.tets]):

            def gap(xi, nodes=nodes, point=point):
                return (functions(np.array([[1 - xi.sum(), *xi]]), TET_EDGES) @ nodes)[0] - point

            solved = root(gap, np.full(3, 0.25), tol=1e-13)
            if np.abs(gap(solved.x)).max() < 1e-11 and min(*solved.x, 1 - solved.x.sum()) >= 0:
                holding[number] = solved.x
        assert list(holding) == [element]
        np.testing.assert_allclose(reference, holding[element], atol=1e-9)


@pytest.mark.parametrize("distortion", [0.0, 0.2])
def test_a_quadratic_displacement_is_exact_on_straight_elements(block, distortion):
    mesh = block(cells=(3, 3, 2), distortion=distortion)
    field, slope, _ = quadratic()
    points = np.random.default_rng(5).uniform(0, 1, (500, 3))
    np.testing.assert_allclose(displacement_at(mesh, field(mesh.points), points), field(points), atol=1e-12)
    np.testing.assert_allclose(displacement_gradient_at(mesh, field(mesh.points), points), slope(points), atol=1e-11)


def test_on_curved_elements_places_and_affine_displacements_are_exact(block):
    mesh = block(**CURVED)
    points = np.random.default_rng(6).uniform(0, 1, (500, 3)) * CURVED["size"]
    np.testing.assert_allclose(PointLocator(mesh).locate(points).interpolate(mesh.points), points, atol=1e-13)
    slope = np.array([[0.1, -0.4, 0.2], [0.3, 0.2, -0.1], [0.0, 0.5, -0.3]])
    displacement = mesh.points @ slope.T + (1, 2, 3)
    np.testing.assert_allclose(displacement_at(mesh, displacement, points), points @ slope.T + (1, 2, 3), atol=1e-12)
    gradient = displacement_gradient_at(mesh, displacement, points)
    np.testing.assert_allclose(gradient, np.broadcast_to(slope, gradient.shape), atol=1e-11)


def test_any_displacement_is_that_of_the_element_s_functions(block):
    mesh = block(**CURVED)
    displacement = np.random.default_rng(7).normal(size=mesh.points.shape)
    element, xi, place = drawn(mesh, 300)
    barycentric = np.concatenate([1 - xi.sum(axis=1, keepdims=True), xi], axis=1)
    expected = np.einsum("pa,pai->pi", functions(barycentric, TET_EDGES), displacement[mesh.tets[element]])
    np.testing.assert_allclose(displacement_at(mesh, displacement, place), expected, atol=1e-11)
    step = 1e-5
    moved = [displacement_at(mesh, displacement, place + h, 1e-3) for h in (*np.eye(3) * step, *np.eye(3) * -step)]
    differences = np.stack([(moved[k] - moved[k + 3]) / (2 * step) for k in range(3)], axis=2)
    inner = np.minimum(xi.min(axis=1), 1 - xi.sum(axis=1)) > 1e-3
    gradient = displacement_gradient_at(mesh, displacement, place)
    np.testing.assert_allclose(gradient[inner], differences[inner], atol=1e-5)


@pytest.mark.parametrize("shape", [(), (3, 3)])
def test_scalars_and_tensors_are_interpolated_too(block, shape):
    mesh = block(cells=(2, 1, 1))
    slope = np.random.default_rng(8).normal(size=(*shape, 3))
    points = np.random.default_rng(9).uniform(0, 1, (20, 3))
    found = PointLocator(mesh).locate(points)
    values = np.einsum("...j,nj->n...", slope, mesh.points)
    np.testing.assert_allclose(found.interpolate(values), np.einsum("...j,pj->p...", slope, points), atol=1e-13)
    np.testing.assert_allclose(found.gradient(values), np.broadcast_to(slope, (20, *shape, 3)), atol=1e-12)


def test_nodes_have_their_own_displacement(block):
    mesh = block(**CURVED)
    displacement = np.random.default_rng(10).normal(size=mesh.points.shape)
    np.testing.assert_allclose(displacement_at(mesh, displacement, mesh.points), displacement, atol=1e-11)


@pytest.mark.parametrize("cell", ["hemispheric", "parallelepiped"])
def test_points_of_a_pad_s_own_surface_are_inside(cell):
    mesh = meshed(cell, 0.8)
    points = on_faces(mesh, mesh.faces, 2000)
    found = PointLocator(mesh).locate(points)
    assert not found.offset.any()
    np.testing.assert_allclose(found.interpolate(mesh.points), points, atol=1e-12)


def test_a_curved_edge_may_leave_the_box_of_its_nodes():
    corners = np.array([[0, 0, 0], [1, 0.3, 0], [0, 1, 0], [0, 0, 1.0]])
    nodes = np.concatenate([corners, corners[np.array(TET_EDGES)].mean(axis=1)])
    nodes[4, 1] -= 0.1
    faces = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6]])
    mesh = VolumeMesh(nodes, np.arange(10)[None], faces, *np.zeros((2, 4), int))
    assert jacobians(nodes, mesh.tets).min() > 0.1
    t = np.linspace(0, 0.25, 11)[1:-1]
    edge = np.stack([t, 0.3 * t - 0.4 * t * (1 - t), 0 * t], axis=1)
    assert edge[:, 1].max() < 0
    found = PointLocator(mesh).locate(edge)
    assert not found.offset.any()
    np.testing.assert_allclose(found.reference, np.stack([t, 0 * t, 0 * t], axis=1), atol=1e-12)


def test_an_element_is_found_behind_many_smaller_ones(block):
    """The hundreds of centroids nearest to the points are all those of another block, with small elements."""
    small, large = block(size=(1, 1, 0.2), cells=(12, 12, 3)), block(cells=(1, 1, 1))
    places = np.concatenate([small.points - (0, 0, 0.21), large.points])
    first = len(small.points)
    faces = np.concatenate([small.faces, large.faces + first])
    mesh = VolumeMesh(places, np.concatenate([small.tets, large.tets + first]), faces, *np.zeros((2, len(faces)), int))
    points = np.random.default_rng(11).uniform(0, 1, (50, 3)) * (1, 1, 0.01)
    found = PointLocator(mesh).locate(points)
    assert found.element.min() >= len(small.tets)
    np.testing.assert_allclose(found.interpolate(mesh.points), points, atol=1e-13)


@pytest.mark.parametrize("size", [(1.0, 1.0, 1.0), (3.0, 1.0, 0.5)])
def test_the_distance_to_a_block_is_that_of_its_planes(block, size):
    """Beside faces, edges and corners."""
    locator = PointLocator(block(size=size, cells=(3, 2, 2), distortion=0.1))
    points = np.random.default_rng(12).uniform(-1, 2, (400, 3)) * size
    beside = np.maximum(points - size, 0) + np.minimum(points, 0)
    distance = np.linalg.norm(beside, axis=1)
    found = locator.locate(points, 10)
    np.testing.assert_allclose(found.offset, beside, atol=1e-9)
    assert 0 < np.count_nonzero(distance == 0) < len(points)
    for point, away in zip(points[distance > 0][:20], distance[distance > 0], strict=False):
        with pytest.raises(InputError, match=re.escape(f" lies outside the silicone, {away:.3g} mm from it")):
            locator.locate([point], 0.999 * away)
        locator.locate([point], 1.001 * away)


@pytest.mark.parametrize("fraction", [0.7, 0.99])
def test_the_distance_to_a_dome_is_that_of_its_sphere(fraction):
    pad = Pad("hemispheric", rows=1, columns=1)
    direction = np.random.default_rng(13).normal(size=(100, 3)) * (1, 1, 0.5)
    direction[:, 2] = np.abs(direction[:, 2]) + 0.5
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    points = (0, 0, pad.top_of_cell - pad.shape.roof_radius) + fraction * pad.shape.roof_radius * direction
    found = PointLocator(meshed("hemispheric", 0.8)).locate(points, 2)
    expected = (fraction - 1) * pad.shape.roof_radius * direction
    distance = np.linalg.norm(found.offset, axis=1)
    np.testing.assert_allclose(distance, (1 - fraction) * pad.shape.roof_radius, atol=1e-3)
    np.testing.assert_allclose(found.offset, expected, atol=0.03)


@pytest.mark.parametrize("distance", [0.02, 0.01])
def test_beside_the_silicone_the_error_is_of_second_order(block, distance):
    mesh = block(cells=(2, 2, 2), distortion=0.1)
    field, slope, curvature = quadratic()
    rng = np.random.default_rng(14)
    points = np.column_stack([rng.uniform(0, 1, (50, 2)), np.full(50, 1 + distance)])
    with pytest.raises(InputError, match="lies outside"):
        displacement_at(mesh, field(mesh.points), points, 0.99 * distance)
    error = displacement_at(mesh, field(mesh.points), points, 1.01 * distance) - field(points)
    expected = np.tile(-0.5 * distance**2 * curvature[:, 2, 2], (50, 1))
    np.testing.assert_allclose(error, expected, atol=1e-11)
    at_the_top = slope(points - (0, 0, distance))
    np.testing.assert_allclose(
        displacement_gradient_at(mesh, field(mesh.points), points, 1.01 * distance), at_the_top, atol=1e-10
    )


def test_the_roof_of_a_finer_mesh_lies_within_a_tolerance():
    coarse, fine = meshed("hemispheric", 0.8), meshed("hemispheric", 0.5)
    points = on_faces(fine, fine.faces[fine.face_region == REGIONS["roof"]], 1000)
    with pytest.raises(InputError, match="lies outside the silicone"):
        displacement_at(coarse, coarse.points, points)
    found = PointLocator(coarse).locate(points, 0.01)
    assert 0 < np.count_nonzero(found.offset.any(axis=1)) < 1000
    np.testing.assert_allclose(found.interpolate(coarse.points), points, atol=1e-12)


def test_the_first_point_outside_is_named(block):
    mesh = block()
    inside, near, far = (0.5, 0.5, 0.5), (0.25, 0.5, 1.125), (500, 0, 0)
    for points, named in (
        ([inside, near, far], r"\(0.25, 0.5, 1.125\).* 0.125 mm from it"),
        ([inside, far, near], r"\(500, 0, 0\).* 499 mm from it"),
        ([inside] * (POINTS_AT_ONCE + 1) + [near], r"\(0.25, 0.5, 1.125\)"),
    ):
        with pytest.raises(InputError, match=f"^point {named}") as caught:
            displacement_at(mesh, mesh.points, points)
        assert "\n" not in str(caught.value)


def test_no_points_are_no_displacements(block):
    mesh = block()
    assert displacement_at(mesh, mesh.points, np.empty((0, 3))).shape == (0, 3)
    assert displacement_gradient_at(mesh, mesh.points, np.empty((0, 3))).shape == (0, 3, 3)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ([0.5, 0.5, 0.5], r"points of shape \(3,\)"),
        ([[0.5, 0.5]], r"points of shape \(1, 2\)"),
        ([["a", "b", "c"]], r"points of shape \(1, 3\) .* numbers are needed"),
        ([[0.5, 0.5, 0.5], [0.5, math.nan, 0.5]], r"points\[1\] = \[0.5, nan, 0.5\]"),
        ([[math.inf, 0.5, 0.5]], r"points\[0\] = "),
    ],
)
def test_points_that_are_none_are_refused(block, points, said):
    mesh = block()
    with pytest.raises(InputError, match=said):
        displacement_at(mesh, mesh.points, points)


@pytest.mark.parametrize("tolerance", [-0.1, math.nan, math.inf])
def test_tolerances_out_of_range_are_refused(block, tolerance):
    mesh = block()
    with pytest.raises(InputError, match="^tolerance = "):
        displacement_at(mesh, mesh.points, [(0.5, 0.5, 0.5)], tolerance)
