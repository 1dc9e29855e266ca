"""The curved walls of cells: where they are, their normals, and triangles that have their mean."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.mechanics import NeoHookean, load_path, tessellate
from mitsuba_taxel.pads import REGIONS, Pad

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

CENTRE = {"hemispheric": 0.5, "spherical": 1.6 - 2.55}


def state_of(cell, force=(0, 0, 0), mesh_size=1.25):
    pad = Pad(cell, rows=1, columns=1)
    return pad, load_path(pad, NeoHookean(), [force], mesh_size=mesh_size)[0]


@pytest.mark.parametrize("cell", ["hemispheric", "spherical"])
def test_round_roofs_are_on_the_sphere(cell):
    """The elements' parabolas alone are 3e-3 mm off it; the rim stays on cylinder and plane, and the board's edge."""
    pad, state = state_of(cell)
    surface = tessellate(state, 6, pad=pad)
    roof = surface.triangles[surface.region == REGIONS["roof"]]
    from_centre = surface.vertices[roof] - (0, 0, CENTRE[cell])
    np.testing.assert_allclose(np.linalg.norm(from_centre, axis=2), pad.shape.roof_radius, rtol=1e-12)
    normals = surface.normals[surface.region == REGIONS["roof"]]
    np.testing.assert_allclose(normals, -from_centre / pad.shape.roof_radius, atol=3e-5)  # on the rim, those of nearby
    side = np.unique(surface.triangles[surface.region == REGIONS["side"]])
    np.testing.assert_allclose(np.linalg.norm(surface.vertices[side, :2], axis=1), 1.275, rtol=1e-12)
    rim = np.intersect1d(roof, side)
    np.testing.assert_allclose(surface.vertices[rim, 2], pad.side_height, rtol=1e-12)
    at_board = surface.vertices[:, 2] == 0
    assert np.abs(surface.offsets[at_board, 2]).max() < 1e-15
    assert not surface.offsets[~np.isin(np.arange(len(surface.vertices)), np.union1d(roof, side))].any()


@pytest.mark.parametrize("cell", ["hemispheric", "spherical"])
@pytest.mark.parametrize("subdivision", [3, 6, 12])
def test_triangles_have_the_mean_of_the_sphere(cell, subdivision):
    """Exact integrals of the squared distance from the centre over flat triangles: chords fall short by the square of
    their size, triangles that are moved by its square again."""
    pad, state = state_of(cell)
    surface = tessellate(state, subdivision, pad=pad)
    roof = surface.triangles[surface.region == REGIONS["roof"]]

    def short(vertices):
        corners = (vertices - (0, 0, CENTRE[cell]))[roof]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        total = corners.sum(axis=1)
        square = (np.einsum("tki,tki->t", corners, corners) + np.einsum("ti,ti->t", total, total)) / 12
        return 1 - np.sqrt(area @ square / area.sum()) / pad.shape.roof_radius

    assert short(surface.vertices) > 2e-2 / subdivision**2 / (1 if cell == "hemispheric" else 4)
    assert abs(short(surface.facing)) < 0.03 * short(surface.vertices)


def test_flat_cells_stay_as_they_are():
    pad, state = state_of("parallelepiped")
    surface = tessellate(state, 6, pad=pad)
    assert np.abs(surface.offsets).max() < 1e-14
    np.testing.assert_allclose(np.abs(surface.normals).max(axis=2), 1, rtol=1e-12)  # along an axis each


@pytest.mark.parametrize("cell", ["hemispheric", "parallelepiped"])
def test_normals_of_pressed_walls_are_those_of_much_finer_triangles(cell):
    """At nodes, which all cuts share, away from edges: the mean of fine triangles there is the normal, but for the
    angle of a degree or two at which elements meet."""
    pad, state = state_of(cell, (0.2, 0.1, -3.0))
    coarse, fine = tessellate(state, 2, pad=pad), tessellate(state, 24, pad=pad)

    def normals_at_vertices(surface, normals):
        roof = surface.region == REGIONS["roof"]
        total = np.zeros((len(surface.vertices), 3))
        np.add.at(total, surface.triangles[roof], normals[roof])
        edge = np.unique(surface.triangles[~roof])
        total[edge] = 0
        length = np.linalg.norm(total, axis=1)
        keys = map(tuple, np.round(surface.vertices, 8).tolist())
        return {key: n / size for key, n, size in zip(keys, total, length, strict=True) if size > 0}

    a, b, c = (fine.vertices[fine.triangles[:, k]] for k in range(3))
    facets = np.cross(b - a, c - a)
    facets /= np.linalg.norm(facets, axis=1, keepdims=True)
    found = normals_at_vertices(coarse, coarse.normals)
    expected = normals_at_vertices(fine, np.repeat(facets[:, None], 3, axis=1))
    common = sorted(set(found) & set(expected))
    assert len(common) > 20
    angle = np.degrees(np.arccos(np.clip([found[key] @ expected[key] for key in common], -1, 1)))
    assert angle.max() < 2.0 and np.median(angle) < 0.5


def test_a_homogeneous_deformation_carries_the_normals_of_a_sphere():
    pad, state = state_of("hemispheric")
    stretch = np.array([[1.1, 0.05, 0.2], [0.0, 0.9, 0.1], [0.03, 0.0, 0.85]])
    moved = replace(state, displacement=state.mesh.points @ (stretch - np.eye(3)).T)
    before, after = (tessellate(s, 6, pad=pad) for s in (state, moved))
    roof = before.region == REGIONS["roof"]
    expected = before.normals[roof] @ np.linalg.inv(stretch)
    expected /= np.linalg.norm(expected, axis=2, keepdims=True)
    np.testing.assert_allclose(after.normals[roof], expected, atol=1e-12)
