"""Volume meshes of pads against the closed forms of their solids."""

from __future__ import annotations

import math
import subprocess
import sys
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.element_maps import jacobians, worst_element
from mitsuba_taxel.geometry.quadratic_shapes import shape_gradients
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, TET_EDGES
from mitsuba_taxel.pads import CELL_SHAPES, REGIONS, Pad, mesh_pad
from mitsuba_taxel.pads.parametric import meshing
from mitsuba_taxel.pads.parametric.meshing import LEAST_QUALITY, check_room
from mitsuba_taxel.pads.parametric.solid import rounded

QUADRATIC_SURFACE = 2e-3
"""Relative error allowed for areas and volumes of curved cells: 8 or more quadratic faces to a circle."""


WALLS = "roof", "side"


@pytest.fixture(scope="module", params=CELL_SHAPES)
def meshed(request):
    pad = Pad(request.param, rows=2, columns=3)
    return pad, mesh_pad(pad, 0.8)


def cell_measures(pad):
    """Volume, roof area and side area of one cell in closed form."""
    r, top = pad.cell_size / 2, pad.top_of_cell
    if pad.cell == "parallelepiped":
        return 4 * r * r * top, 4 * r * r, 8 * r * top
    if pad.cell == "cylindrical":
        return math.pi * r * r * top, math.pi * r * r, 2 * math.pi * r * top
    sphere = {"spherical": 2 * r, "hemispheric": r}[pad.cell]
    cap = sphere - math.sqrt(sphere**2 - r**2)
    volume = math.pi * r * r * (top - cap) + math.pi * cap**2 * (3 * sphere - cap) / 3
    return volume, 2 * math.pi * sphere * cap, 2 * math.pi * r * (top - cap)


def triangle_rule():
    """Points and weights of a product rule exact to degree 10 on the unit triangle."""
    x, w = np.polynomial.legendre.leggauss(6)
    x, w = (x + 1) / 2, w / 2
    u, v = np.meshgrid(x, x, indexing="ij")
    return np.stack([u, v * (1 - u)], -1).reshape(-1, 2), (np.outer(w, w) * (1 - u)).ravel()


def face_normals(mesh):
    """Points (B, Q, 3) and area vectors (B, Q, 3) at the quadrature points of the curved faces."""
    (xi, eta), weight = triangle_rule()[0].T, triangle_rule()[1]
    zeta = 1 - xi - eta
    shapes = np.stack([*(a * (2 * a - 1) for a in (zeta, xi, eta)), 4 * zeta * xi, 4 * xi * eta, 4 * eta * zeta])
    by_xi = np.stack([1 - 4 * zeta, 4 * xi - 1, 0 * xi, 4 * (zeta - xi), 4 * eta, -4 * eta])
    by_eta = np.stack([1 - 4 * zeta, 0 * xi, 4 * eta - 1, -4 * xi, 4 * xi, 4 * (zeta - eta)])
    nodes = mesh.points[mesh.faces]
    place = np.einsum("bnk,nq->bqk", nodes, shapes)
    normal = np.cross(np.einsum("bnk,nq->bqk", nodes, by_xi), np.einsum("bnk,nq->bqk", nodes, by_eta))
    return place, normal * weight[:, None]


def test_areas_of_the_regions(meshed):
    pad, mesh = meshed
    _, normals = face_normals(mesh)
    areas = np.linalg.norm(normals, axis=-1).sum(axis=1)
    width, depth, height = pad.extent
    _, roof, side = cell_measures(pad)
    hole = pad.cell_size**2 * (1 if pad.cell == "parallelepiped" else math.pi / 4)

    def area(region, cell=None):
        chosen = mesh.face_region == REGIONS[region]
        return areas[chosen & (mesh.face_cell == cell)].sum() if cell is not None else areas[chosen].sum()

    tolerance = 1e-12 if pad.cell == "parallelepiped" else QUADRATIC_SURFACE
    for cell in range(1, 7):
        assert area("roof", cell) == pytest.approx(roof, rel=tolerance)
        assert area("side", cell) == pytest.approx(side, rel=tolerance)
    assert area("bottom") == pytest.approx(width * depth - 6 * hole, rel=tolerance)
    assert area("top") == pytest.approx(width * depth, rel=1e-12)
    assert area("outer") == pytest.approx(2 * (width + depth) * height, rel=1e-12)
    assert set(np.unique(mesh.face_region)) == set(REGIONS.values())
    assert not mesh.face_cell[~np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))].any()


def test_volume_from_the_elements_and_from_the_oriented_surface(meshed):
    pad, mesh = meshed
    expected = math.prod(pad.extent) - 6 * cell_measures(pad)[0]
    points, weights = np.polynomial.legendre.leggauss(3)  # exact to degree 5
    points, weights = (points + 1) / 2, weights / 2
    u, v, w = (a.ravel() for a in np.meshgrid(points, points, points, indexing="ij"))
    xi = np.stack([u, v * (1 - u), w * (1 - u) * (1 - v)], -1)  # the cube folded onto the tetrahedron
    weight = np.einsum("i,j,k->ijk", weights, weights, weights).ravel() * (1 - u) ** 2 * (1 - v)
    jacobian = np.einsum("qai,maj->mqij", shape_gradients(xi), mesh.points[mesh.tets])
    volume = (np.linalg.det(jacobian) @ weight).sum()
    place, normal = face_normals(mesh)
    enclosed = np.einsum("bqk,bqk->", place, normal) / 3
    tolerance = 1e-12 if pad.cell == "parallelepiped" else QUADRATIC_SURFACE / 5
    assert volume == pytest.approx(expected, rel=tolerance)
    assert enclosed == pytest.approx(volume, rel=1e-12)


def test_cells_lie_where_their_numbers_say(meshed):
    pad, mesh = meshed
    for number, (x, y) in enumerate(pad.cell_centres, start=1):
        nodes = mesh.points[mesh.faces[mesh.face_cell == number]].reshape(-1, 3)
        assert np.abs(nodes[:, :2] - (x, y)).max() <= pad.cell_size / 2 + 1e-9
        assert nodes[:, 2].max() == pytest.approx(pad.top_of_cell, abs=2e-3)
        assert nodes[:, 2].min() == 0


@pytest.mark.parametrize("cell", ["spherical", "hemispheric"])
def test_curved_roofs_lie_on_their_spheres(cell):
    pad = Pad(cell, rows=1, columns=2)
    mesh = mesh_pad(pad, 0.8)
    for number, (x, y) in enumerate(pad.cell_centres, start=1):
        roof = mesh.faces[(mesh.face_cell == number) & (mesh.face_region == REGIONS["roof"])]
        centre = (x, y, pad.top_of_cell - pad.shape.roof_radius)
        radius = np.linalg.norm(mesh.points[np.unique(roof)] - centre, axis=1)
        np.testing.assert_allclose(radius, pad.shape.roof_radius, rtol=1e-6)


def test_elements_are_conforming_and_upright(meshed):
    _, mesh = meshed
    assert jacobians(mesh.points, mesh.tets).min() > 0.1
    corners = mesh.points[mesh.tets[:, :4]]
    assert np.linalg.det(corners[:, 1:] - corners[:, :1]).min() > 0
    sides = np.sort(mesh.tets[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
    unique, counts = np.unique(sides, axis=0, return_counts=True)
    assert counts.max() == 2
    boundary = np.sort(mesh.faces[:, :3], axis=1)
    np.testing.assert_array_equal(np.unique(boundary, axis=0), unique[counts == 1])
    assert len(boundary) == np.count_nonzero(counts == 1)
    for elements, edges, corners in ((mesh.tets, TET_EDGES, 4), (mesh.faces, FACE_EDGES, 3)):
        ends = np.sort(elements[:, np.array(edges)], axis=2).reshape(-1, 2)
        middle = elements[:, corners:].reshape(-1, 1)
        pairs = np.unique(np.concatenate([ends, middle], axis=1), axis=0)
        assert len(pairs) == len(np.unique(pairs[:, :2], axis=0)) == len(np.unique(pairs[:, 2]))
    assert np.unique(mesh.tets).size == len(mesh.points)


def test_the_mesh_has_the_pad_s_symmetry_to_the_bit(meshed):
    _, mesh = meshed
    known = {tuple(point) for point in (mesh.points + 0.0).tolist()}
    for axis in (0, 1):
        reflected = mesh.points.copy()
        reflected[:, axis] *= -1
        assert {tuple(point) for point in (reflected + 0.0).tolist()} == known


@pytest.mark.parametrize("cell", CELL_SHAPES)
@pytest.mark.parametrize(
    "arguments",
    [
        {"rows": 1, "columns": 1},
        {"rows": 2, "columns": 1, "wall": 0.3},
        {"rows": 1, "columns": 2, "height": 2.0},
    ],
)
def test_other_pads_mesh_too(cell, arguments):
    pad = Pad(cell, **arguments)
    mesh = mesh_pad(pad, 1.0)
    _, normals = face_normals(mesh)
    top = np.linalg.norm(normals[mesh.face_region == REGIONS["top"]], axis=-1).sum()
    assert top == pytest.approx(pad.extent[0] * pad.extent[1], rel=1e-12)
    assert set(np.unique(mesh.face_cell)) == set(range(pad.rows * pad.columns + 1))
    assert jacobians(mesh.points, mesh.tets).min() > 0


@pytest.mark.parametrize(("cell", "wall", "size"), [("hemispheric", 0.1, 0.8), ("cylindrical", 0.3, 2.0)])
def test_thin_walls_beside_round_cells(cell, wall, size):
    mesh = mesh_pad(Pad(cell, rows=1, columns=2, pitch=2.55 + wall, wall=wall), size)
    assert jacobians(mesh.points, mesh.tets).min() > 0.1


@pytest.mark.parametrize(("wall", "is_slender"), [(0.3, True), (1.0, False)])
def test_elements_of_slender_walls_follow_their_height(wall, is_slender):
    """Five and more along it, however large the others are: a wall buckles at the load of the silicone's thickness."""
    pad = Pad("parallelepiped", rows=1, columns=2, pitch=2.55 + wall, wall=wall)

    def longest(size):
        mesh = mesh_pad(pad, size)
        corners = mesh.points[mesh.faces[mesh.face_region == REGIONS["side"], :3]]
        return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max()

    coarse, default = longest(2.5), longest(pad.default_mesh_size)
    assert (coarse < 0.5 * pad.side_height) == is_slender and default < 0.7 * pad.side_height
    assert (coarse < 1.2 * default) == is_slender


@pytest.mark.parametrize("factor", [1 / 12, 1000 / 12])
def test_pads_of_any_size_mesh_alike(factor):
    pad = Pad("hemispheric", rows=1, columns=1)
    lengths = ("pitch", "wall", "height", "cell_size", "cell_height")
    scaled = replace(pad, **{name: factor * getattr(pad, name) for name in lengths})
    mesh, similar = mesh_pad(pad, 1.0), mesh_pad(scaled, factor)
    assert len(similar.tets) == pytest.approx(len(mesh.tets), rel=0.1)
    volume, other = (np.einsum("bqk,bqk->", *face_normals(m)) / 3 for m in (mesh, similar))
    assert other == pytest.approx(factor**3 * volume, rel=1e-3)
    assert jacobians(similar.points, similar.tets).min() > 0.1


def test_the_same_pad_gets_the_same_mesh():
    first, second = (mesh_pad(Pad("spherical", rows=1, columns=1), 1.0) for _ in range(2))
    np.testing.assert_array_equal(first.points, second.points)
    np.testing.assert_array_equal(first.tets, second.tets)


def test_so_many_slender_walls_do_not_fit():
    """However large the other elements are."""
    pad = Pad("parallelepiped", rows=40, columns=40, pitch=2.85)
    with pytest.raises(InputError, match="^rows = 40, columns = 40 are not allowed with walls of 0.3 mm"):
        mesh_pad(pad, 2.0)


@pytest.mark.parametrize("size", [0.0, -1.0, math.nan, math.inf, 1e-3])
def test_mesh_sizes_out_of_range_are_refused(size):
    with pytest.raises(InputError, match="^mesh_size = "):
        mesh_pad(Pad(), size)


def test_meshing_prints_nothing(capfd):
    mesh_pad(Pad("hemispheric", rows=1, columns=1), 1.5)
    assert capfd.readouterr() == ("", "")


def test_importing_the_rooms_imports_no_solver_nor_mesher():
    code = (
        "import sys, mitsuba_taxel.pads, mitsuba_taxel.mechanics; "
        "print([m for m in ('netgen', 'scipy', 'rslab', 'trimesh') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


ROUND = [("hemispheric", 2, 1.0), ("cylindrical", 3, 1.0), ("spherical", 2, 0.5)]


@pytest.mark.parametrize(("cell", "rows", "wall"), ROUND)
def test_smaller_elements_are_more_elements(cell, rows, wall):
    """To a tenth, by which meshes are irregular; a distorted element once cost twice as many."""
    pad = Pad(cell, rows, 3, pitch=2.55 + wall, wall=wall)
    counts = np.array([len(mesh_pad(pad, size).tets) for size in (1.77, 1.49, 1.25, 1.05, 0.9, 0.83)])
    assert np.all(counts[1:] > 0.9 * counts[:-1]) and counts[-1] > 2 * counts[0], counts


@pytest.mark.parametrize(("cell", "share"), [("parallelepiped", 0.5), ("cylindrical", 0.5), ("spherical", 1.0)])
def test_finer_meshes_of_flat_roofs_are_finer_still_along_their_rims(cell, share, monkeypatch):
    """Mean lengths of elements along the rim, against those without; up to what divides a rim evenly."""
    pad = Pad(cell, rows=1, columns=1)

    def along_rim(size):
        mesh = mesh_pad(pad, size)
        ends = mesh.faces[:, :3][:, np.array(FACE_EDGES)]
        edges = [np.unique(np.sort(ends[mesh.face_region == REGIONS[name]].reshape(-1, 2)), axis=0) for name in WALLS]
        both, count = np.unique(np.concatenate(edges), axis=0, return_counts=True)
        return np.linalg.norm(np.subtract(*mesh.points[both[count == 2]].transpose(1, 0, 2)), axis=1).mean()

    sizes = [relative * pad.default_mesh_size for relative in (1.6, 1.0, 0.7)]
    graded = [along_rim(size) for size in sizes]
    monkeypatch.setattr(meshing, "FINER_EDGES", 1.0)
    shares = np.divide(graded, [along_rim(size) for size in sizes])
    np.testing.assert_allclose(shares, [1.0, 1.0, share], rtol=0.15)


def test_a_deep_and_narrow_cell_costs_little():
    """Its wall needs no elements as small as its dome's all the way down."""
    pad = Pad("hemispheric", rows=1, columns=1, cell_size=1e-3, cell_height=1.55, height=3.0, wall=1.5)
    mesh = mesh_pad(pad, 1.5)
    assert len(mesh.tets) < 40_000
    assert worst_element(mesh)[0] >= LEAST_QUALITY
    roof = np.unique(mesh.faces[mesh.face_region == REGIONS["roof"]])
    radius = np.linalg.norm(mesh.points[roof] - (0, 0, 1.55 - 0.5e-3), axis=1)
    np.testing.assert_allclose(radius, 0.5e-3, rtol=1e-3)


def test_lengths_in_metres_are_refused_by_the_length_that_is_given():
    pad = Pad("cylindrical", rows=1, columns=1, cell_size=0.00255)
    with pytest.raises(InputError, match=r"^cell_size = 0\.00255 mm in a pad of .* Lengths are in mm"):
        check_room(pad, pad.default_mesh_size)
    with pytest.raises(InputError, match=r"^mesh_size = 1e-05 is not allowed"):
        check_room(pad, 1e-5)


def test_memory_does_not_grow_with_faces_times_cells():
    """The distance of each face to each of 3600 cells would take some 100 MB; the mesh takes less than one."""
    mesh = mesh_pad(Pad(rows=1, columns=1), 2.5)
    many = Pad(rows=60, columns=60)
    tracemalloc.start()
    try:
        meshing._numbered(mesh, many)
        rounded(mesh, many)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 8e6
