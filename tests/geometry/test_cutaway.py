"""Surfaces cut open: closed again, with the area and the volume that closed forms and the volume mesh give."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from mitsuba_taxel import NeoHookean, Pad, load_path, tessellate
from mitsuba_taxel.geometry.surfaces.cutaway import NUDGE, cut_open, is_closed
from mitsuba_taxel.geometry.surfaces.polygons import triangulated
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, half_edges, volume

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

ALONG_Y = np.array([0.0, 1.0, 0.0])
SHAPES = ("parallelepiped", "cylindrical", "spherical", "hemispheric")
SUBTETS = np.array(
    [(0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3), (4, 6, 7, 8), (4, 5, 6, 8), (6, 7, 8, 9), (5, 6, 8, 9)]
)
"""Tetrahedra of corners and mid-edge nodes, in the order of `TET_EDGES`."""


def surface_of(pad: Pad, force: float = 0.0):
    state = load_path(pad, NeoHookean(), [[0, 0, force]])[0]
    surface = tessellate(state)
    return state, surface.vertices, surface.triangles.astype(np.int64)


def cut_volume(half) -> float:
    """Volume inside what a cut leaves of a closed surface, by the divergence theorem."""
    return volume(half.vertices, half.triangles) if len(half.triangles) else 0.0


def cell_section(pad: Pad, y: float) -> float:
    """Area of a cell's section at a distance from its axis, mm²."""
    if pad.cell == "parallelepiped":
        return pad.cell_size * pad.top_of_cell
    half = math.sqrt((0.5 * pad.cell_size) ** 2 - y**2)
    area = 2 * half * pad.side_height
    if "roof" in pad.shape.round_regions:
        sphere = math.sqrt(pad.shape.roof_radius**2 - y**2)
        return area + sphere**2 * math.asin(half / sphere) - half * math.sqrt(sphere**2 - half**2)
    return area


def volume_beyond(points: np.ndarray, tets: np.ndarray, offset: float) -> float:
    """Volume of tetrahedra where y > offset: each by the divided difference of the cube of its heights."""
    corners = points[tets]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    # Heights apart from each other, or the difference has no place to divide.
    height = corners[..., 1] - offset + 1e-5 * np.array([0.1, 0.2, 0.3, 0.4]) + 1e-9 * np.arange(len(tets))[:, None]
    share = np.zeros(len(tets))
    for k in range(4):
        others = np.delete(height, k, axis=1)
        share += np.where(height[:, k] > 0, height[:, k] ** 3 / np.prod(height[:, [k]] - others, axis=1), 0)
    return float(volumes @ np.clip(share, 0, 1))


def face_areas(half) -> np.ndarray:
    """Areas of the triangles of the cut face, positive if they look along -y."""
    return area_normals(half.vertices, half.triangles[half.source < 0]) @ -ALONG_Y


@pytest.mark.parametrize("y", [0.0, 0.6])
@pytest.mark.parametrize("cell", SHAPES)
def test_section_of_a_pad(cell, y):
    pad = Pad(cell=cell, rows=1, columns=2)
    _, vertices, triangles = surface_of(pad)
    half, other = (cut_open(vertices, triangles, sign * ALONG_Y, sign * y) for sign in (1, -1))
    assert is_closed(half.triangles) and is_closed(other.triangles)
    areas = face_areas(half)
    assert areas.min() >= 0
    length, depth, height = pad.extent
    cells = 2 * cell_section(pad, y)
    # Chords in place of arcs: relative to the cell by at most the square of half their angle.
    assert areas.sum() == pytest.approx(length * height - cells, abs=2e-3 * cells)
    whole = volume(vertices, triangles)
    moved = 2 * NUDGE * max(pad.extent) * areas.sum()  # the difference itself, where corners lie on both planes
    assert cut_volume(half) + cut_volume(other) == pytest.approx(whole, abs=moved + 1e-12 * whole)
    if y == 0:
        assert cut_volume(half) == pytest.approx(0.5 * whole, abs=moved)


@pytest.mark.parametrize("cell, y", [("parallelepiped", 0.9), ("hemispheric", 0.0), ("hemispheric", -0.7)])
def test_volume_of_a_deformed_pad(cell, y):
    """By the divergence theorem, against that of the tetrahedra it was solved on."""
    pad = Pad(cell=cell, rows=1, columns=1)
    state, vertices, triangles = surface_of(pad, -2.0)
    half = cut_open(vertices, triangles, ALONG_Y, y)
    assert is_closed(half.triangles)
    tets = state.mesh.tets[:, SUBTETS].reshape(-1, 4)
    points = state.mesh.points + state.displacement
    assert cut_volume(half) == pytest.approx(volume_beyond(points, tets, y), rel=2e-3)


def test_every_triangle_knows_where_it_comes_from():
    _, vertices, triangles = surface_of(Pad(rows=1, columns=1))
    half = cut_open(vertices, triangles, ALONG_Y, 0.3)
    old = half.source >= 0
    before = area_normals(vertices, triangles)[half.source[old]]
    after = area_normals(half.vertices, half.triangles[old])
    assert np.all(np.einsum("ij,ij->i", before, after) >= -1e-12)
    assert np.all(np.linalg.norm(after, axis=1) <= np.linalg.norm(before, axis=1) * (1 + 1e-6) + 1e-12)
    assert half.vertices[half.triangles][..., 1].min() >= 0.3 - 1e-12


@pytest.mark.parametrize("normal", [ALONG_Y, np.array([0.6, 0.0, 0.8]), np.array([-2.0, 1.0, 2.0]) / 3])
def test_a_hollow_leaves_a_hole_in_the_face(normal):
    outer, inner = trimesh.creation.icosphere(3, 2.0), trimesh.creation.icosphere(3, 1.0)
    vertices = np.concatenate([outer.vertices, inner.vertices])
    triangles = np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)])
    half = cut_open(vertices, triangles, normal, 0.4)
    assert is_closed(half.triangles)
    face = area_normals(half.vertices, half.triangles[half.source < 0])
    assert (face @ normal).max() <= 1e-12
    assert np.linalg.norm(face, axis=1).sum() == pytest.approx(math.pi * (4 - 1), rel=2e-2)
    shell = math.pi / 3 * ((2 - 0.4) ** 2 * (3 * 2 - 1.6) - (1 - 0.4) ** 2 * (3 - 0.6))
    assert cut_volume(half) == pytest.approx(shell, rel=2e-2)


def test_a_plane_along_edges():
    """A block whose vertices lie on the plane."""
    block = trimesh.creation.box((2, 2, 2)).subdivide().subdivide()
    half = cut_open(block.vertices, block.faces, ALONG_Y, 0.0)
    assert is_closed(half.triangles)
    assert cut_volume(half) == pytest.approx(4, abs=1.01 * 4 * 2 * NUDGE)
    assert face_areas(half).sum() == pytest.approx(4, rel=1e-12)


def test_nothing_to_cut():
    block = trimesh.creation.box((2, 2, 2))
    whole, nothing = (cut_open(block.vertices, block.faces, ALONG_Y, offset) for offset in (-3, 3))
    assert len(whole.triangles) == 12 and np.array_equal(whole.source, np.arange(12))
    assert len(nothing.triangles) == 0 and cut_volume(nothing) == 0


def test_an_open_surface_stays_open():
    block = trimesh.creation.box((2, 2, 2))
    half = cut_open(block.vertices, block.faces[1:], ALONG_Y, 0.1)
    assert np.all(half.source >= 0) and not is_closed(half.triangles)


@pytest.mark.parametrize("seed", range(4))
def test_triangles_of_polygons(seed):
    """A star with holes, and a second one beside it: every edge is used once, no triangle is turned over."""
    random = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    star = circle * random.uniform(4, 9, (60, 1))
    holes = [0.8 * circle[::-4] + shift for shift in ((-1.5, -1.5), (1.5, -1.2), (0.1, 1.8))]
    polygons = [star, *holes, circle[::6] + (20, 0)]
    points = np.concatenate(polygons)
    ends = np.cumsum([0, *map(len, polygons)])
    loops = [np.arange(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]
    rims = np.concatenate([np.stack([loop, np.roll(loop, -1)], axis=1) for loop in loops])
    triangles = triangulated(points, rims)
    corners = points[triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    shoelace = [0.5 * np.sum(np.cross(np.insert(p, 2, 0, 1), np.roll(np.insert(p, 2, 0, 1), -1, 0))) for p in polygons]
    assert areas.min() >= 0
    assert areas.sum() == pytest.approx(sum(shoelace), rel=1e-12)
    edges = {tuple(edge) for edge in half_edges(triangles)[0].tolist()}
    assert {edge for edge in edges if edge[::-1] not in edges} == set(map(tuple, rims.tolist()))
