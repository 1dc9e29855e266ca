"""The deformed surface: closed, smooth on the roofs, of the right volume, and tagged."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.geometry.surfaces.triangles import area_normals
from mitsuba_taxel.mechanics import NeoHookean, load_path, tessellate
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.pads import CELL_SHAPES, REGIONS, Pad

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")


def state_of(cell, force):
    return load_path(Pad(cell, rows=1, columns=2), NeoHookean(), [force], mesh_size=2.0)[0]


def enclosed(surface):
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


@pytest.fixture(scope="module", params=CELL_SHAPES)
def pressed(request):
    return state_of(request.param, (0.3, 0.2, -2.0))


@pytest.mark.parametrize("subdivision", [1, 2, 5, 20])
def test_the_surface_is_closed_and_outward(pressed, subdivision):
    surface = tessellate(pressed, subdivision)
    edges = surface.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    forth = edges[:, 0] * len(surface.vertices) + edges[:, 1]
    back = edges[:, 1] * len(surface.vertices) + edges[:, 0]
    assert len(np.unique(forth)) == len(forth)
    np.testing.assert_array_equal(np.sort(forth), np.sort(back))
    assert len(np.unique(surface.triangles)) == len(surface.vertices)
    assert len(np.unique(np.round(surface.vertices, 9), axis=0)) == len(surface.vertices)
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert area.min() > 1e-7
    assert enclosed(surface) > 0


def test_the_bottom_beside_a_round_cell_does_not_fold():
    """Thin elements along the rim, whose curved edge bulges into them."""
    pad = Pad("spherical", rows=1, columns=2)
    surface = tessellate(load_path(pad, NeoHookean(), [(0, 0, 0)], mesh_size=1.25)[0], 6, pad=pad)
    assert area_normals(surface.vertices, surface.triangles[surface.region == REGIONS["bottom"]])[:, 2].max() < 0


def test_its_volume_converges_to_that_of_the_deformed_elements(pressed):
    pad = LoadedPad(pressed.mesh, NeoHookean())
    elements = pad.model.assembly.elements
    nodal = pressed.displacement[elements.nodes]
    gradient = np.einsum("mai,mqaj->mqij", nodal, elements.gradients) + np.eye(3)
    volume = (elements.weight * np.linalg.det(gradient)).sum()
    errors = [abs(enclosed(tessellate(pressed, n)) / volume - 1) for n in (4, 16)]
    assert errors[1] < 2e-4
    assert tessellate(pressed, 4).triangles.dtype.kind == "i"


def test_vertices_lie_on_the_quadratic_faces(pressed):
    """A face cut into four has the deformed nodes themselves as its vertices."""
    surface = tessellate(pressed, 2)
    deformed = pressed.mesh.points + pressed.displacement
    nodes = {tuple(p) for p in np.round(deformed[np.unique(pressed.mesh.faces)], 9).tolist()}
    assert {tuple(p) for p in np.round(surface.vertices, 9).tolist()} >= nodes


def test_regions_and_cells_are_carried_over(pressed):
    surface = tessellate(pressed, 3)
    assert set(np.unique(surface.region)) == set(REGIONS.values())
    for region in ("roof", "side"):
        assert set(np.unique(surface.cell[surface.region == REGIONS[region]])) == {1, 2}
    others = ~np.isin(surface.region, (REGIONS["roof"], REGIONS["side"]))
    assert not surface.cell[others].any()
    bottom = surface.vertices[surface.triangles[surface.region == REGIONS["bottom"]]]
    assert not bottom[..., 2].any()
    for cell in (1, 2):  # out of the silicone is into the cell
        a, b, c = np.moveaxis(
            surface.vertices[surface.triangles[(surface.region == REGIONS["roof"]) & (surface.cell == cell)]], 1, 0
        )
        middle = np.array([*a.mean(axis=0)[:2], 0.5])
        assert np.all(np.einsum("fi,fi->f", np.cross(b - a, c - a), middle - a) > 0)


@pytest.mark.parametrize("subdivision", [4, 12])
def test_a_dome_is_as_round_as_its_subdivision(subdivision):
    """Flat triangles miss the area by O(1 / subdivision^2), quadratic faces of 0.8 mm by (0.8 / 1.275)^4 / 64."""
    state = load_path(Pad("hemispheric", rows=1, columns=1), NeoHookean(), [(0, 0, 0)], mesh_size=0.8)[0]
    surface = tessellate(state, subdivision)
    roof = surface.triangles[surface.region == REGIONS["roof"]]
    a, b, c = (surface.vertices[roof[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    radial = (0, 0, 0.5) - (a + b + c) / 3
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    angle = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", normal, radial), -1, 1)))
    assert angle.max() < 12 / subdivision + 2.5
    radius = np.linalg.norm(surface.vertices[np.unique(roof)] - (0, 0, 0.5), axis=1)
    np.testing.assert_allclose(radius, 1.275, rtol=3e-3)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(
        2 * math.pi * 1.275**2, rel=0.12 / subdivision**2 + 2.5e-3
    )
