"""Elements cut towards singular edges: the same solid, conforming, and worth their unknowns."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.element_maps import jacobians
from mitsuba_taxel.geometry.mirror import MIRRORS
from mitsuba_taxel.geometry.quadratic_shapes import shape_gradients
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, TET_EDGES
from mitsuba_taxel.mechanics import NeoHookean
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.locate import displacement_at
from mitsuba_taxel.pads import CELL_SHAPES, REGIONS, Pad, mesh_pad
from mitsuba_taxel.pads.parametric import meshing
from mitsuba_taxel.pads.parametric.grading import cut_towards
from mitsuba_taxel.pads.parametric.solid import singular_nodes

SIDES = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]


@pytest.fixture(scope="module", params=CELL_SHAPES)
def uncut(request):
    """Netgen's mesh of the symmetric part of a pad, and its singular nodes."""
    pad = Pad(request.param, rows=1, columns=1)
    mesh = meshing._generated(pad, 1.0, 3.0)
    return mesh, singular_nodes(mesh, pad)


@pytest.fixture(params=["singular edges", "corners at random"])
def cut(request, uncut):
    """At random corners every way in which an element can fall apart occurs."""
    mesh, chosen = uncut
    if request.param == "corners at random":
        chosen = np.random.default_rng(1).uniform(size=len(mesh.points)) < 0.4
        count = chosen[mesh.tets[:, :4]].sum(axis=1)
        assert set(count) == {0, 1, 2, 3, 4}
    return mesh, cut_towards(mesh, chosen, 0.2)


def volumes(mesh):
    """(M,) of the curved elements, by a product rule that is exact for them."""
    x, w = np.polynomial.legendre.leggauss(4)
    x, w = (x + 1) / 2, w / 2
    u, v, t = (a.ravel() for a in np.meshgrid(x, x, x, indexing="ij"))
    xi = np.stack([u, v * (1 - u), t * (1 - u) * (1 - v)], -1)
    weight = np.einsum("i,j,k->ijk", w, w, w).ravel() * (1 - u) ** 2 * (1 - v)
    return np.linalg.det(np.einsum("qai,maj->mqij", shape_gradients(xi), mesh.points[mesh.tets])) @ weight


def flux(mesh, region):
    """(3,) integral of the normal over a region: the curved faces' area vectors."""
    nodes = mesh.points[mesh.faces[mesh.face_region == region]]
    area = np.cross(nodes[:, 1] - nodes[:, 0], nodes[:, 2] - nodes[:, 0]) / 2
    for k, (i, j) in enumerate(FACE_EDGES, start=3):
        area += np.cross(nodes[:, k] - nodes[:, i], nodes[:, j] - nodes[:, i]) * 2 / 3
    return area.sum(axis=0)


def test_the_solid_stays_as_it_is(cut):
    before, after = cut
    assert len(after.tets) > len(before.tets)
    assert volumes(after).min() > 0
    assert volumes(after).sum() == pytest.approx(volumes(before).sum(), rel=1e-12)
    for region in REGIONS.values():
        np.testing.assert_allclose(flux(after, region), flux(before, region), atol=1e-12)


def test_flat_surfaces_keep_their_area(cut):
    before, after = cut
    for region in ("bottom", "top", "outer"):
        areas = []
        for mesh in (before, after):
            corner = mesh.points[mesh.faces[mesh.face_region == REGIONS[region], :3]]
            normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
            areas.append(np.linalg.norm(normal, axis=1).sum())
        # A round rim is made of parabolas, of which the straight triangles have a part that grows as they are cut.
        assert areas[1] == pytest.approx(areas[0], rel=2e-2 if region == "bottom" else 1e-12)


def test_pieces_are_conforming_and_upright(cut):
    before, mesh = cut
    corners = mesh.points[mesh.tets[:, :4]]
    assert np.linalg.det(corners[:, 1:] - corners[:, :1]).min() > 0
    # A piece of a curved element is no more bent than the whole was at its worst.
    assert jacobians(mesh.points, mesh.tets).min() > 0.5 * jacobians(before.points, before.tets).min()
    sides, count = np.unique(np.sort(mesh.tets[:, SIDES].reshape(-1, 3), axis=1), axis=0, return_counts=True)
    assert count.max() == 2
    alone = mesh.points[sides[count == 1]]
    cut_plane = np.all(alone[:, :, 1] == 0, axis=1) | np.all(alone[:, :, 0] == alone[:, :, 1], axis=1)
    surface = np.unique(np.sort(mesh.faces[:, :3], axis=1), axis=0)
    assert len(surface) == len(mesh.faces) == np.count_nonzero(~cut_plane)
    np.testing.assert_array_equal(surface, sides[count == 1][~cut_plane])
    for elements, edges, first in ((mesh.tets, TET_EDGES, 4), (mesh.faces, FACE_EDGES, 3)):
        ends = np.sort(elements[:, np.array(edges)], axis=2).reshape(-1, 2)
        pairs = np.unique(np.concatenate([ends, elements[:, first:].reshape(-1, 1)], axis=1), axis=0)
        assert len(pairs) == len(np.unique(pairs[:, :2], axis=0)) == len(np.unique(pairs[:, 2]))
    assert np.unique(mesh.tets).size == len(mesh.points)


def test_edges_are_cut_at_the_fraction_asked_for(uncut):
    mesh, _ = uncut
    chosen = np.zeros(len(mesh.points), dtype=bool)
    chosen[mesh.tets[0, 0]] = True
    for fraction in (0.15, 0.3):
        pieces = cut_towards(mesh, chosen, fraction)
        at = np.flatnonzero(np.all(pieces.points == mesh.points[mesh.tets[0, 0]], axis=1))
        touching = np.any(pieces.tets[:, :4] == at, axis=1)
        whole = np.any(mesh.tets[:, :4] == mesh.tets[0, 0], axis=1)
        scale = volumes(pieces)[touching].sum() / volumes(mesh)[whole].sum()
        assert scale == pytest.approx(fraction**3, rel=0.3 if fraction > 0.2 else 0.4)


def test_nothing_chosen_leaves_the_elements(uncut):
    mesh, _ = uncut
    same = cut_towards(mesh, np.zeros(len(mesh.points), dtype=bool), 0.2)
    np.testing.assert_array_equal(same.points[same.tets], mesh.points[mesh.tets])
    np.testing.assert_array_equal(same.points[same.faces], mesh.points[mesh.faces])


def roof_displacement(mesh, places):
    pad = LoadedPad(mesh, NeoHookean(), mirrors=MIRRORS, images=node_images(mesh))
    solution, _ = pad.solve(np.zeros(pad.unknowns), np.array([0, 0, -2.0]))
    return pad.unknowns, displacement_at(mesh, pad.split(solution.unknowns)[0], places, 0.1)


@pytest.mark.parametrize("cell", ["parallelepiped", "cylindrical"])
def test_cut_elements_are_worth_their_unknowns(cell, monkeypatch):
    """Roof displacements against those of a finer mesh: the cut nearly halves the error, a finer mesh does not."""
    pad = Pad(cell, rows=1, columns=1)
    fine = mesh_pad(pad, 0.5)
    roof = np.unique(fine.faces[fine.face_region == REGIONS["roof"]])
    places = fine.points[roof[fine.points[roof, 0] >= np.abs(fine.points[roof, 1])]]
    _, reference = roof_displacement(fine, places)

    def error(mesh):
        unknowns, displacement = roof_displacement(mesh, places)
        wrong = np.linalg.norm(displacement - reference, axis=1) / np.linalg.norm(reference, axis=1).max()
        return unknowns, np.quantile(wrong, 0.95)

    unknowns, cut = error(mesh_pad(pad, 1.0))
    monkeypatch.setattr(meshing, "cut_towards", lambda mesh, singular, fraction: mesh)
    _, coarse = error(mesh_pad(pad, 1.0))
    more_unknowns, finer = error(mesh_pad(pad, 0.6))
    assert more_unknowns > 0.9 * unknowns
    assert cut < 0.6 * coarse
    assert cut < 0.9 * finer
