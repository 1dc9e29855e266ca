"""A pad from a surface reads as the parametric pad that the surface was taken from."""

from __future__ import annotations

import hashlib
import json
import math
import platform
import shutil
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.element_maps import jacobians, worst_element
from mitsuba_taxel.geometry.quadratic_shapes import shape_gradients
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, TET_EDGES, VolumeMesh
from mitsuba_taxel.pads import REGIONS, Pad, mesh_pad
from mitsuba_taxel.pads.imported.rules import Rule
from mitsuba_taxel.pads.pad_file import PadFile, mesh_pad_file
from mitsuba_taxel.scenes import hexagonal

DOME = Rule("roof", normal=(0, 0, -1), within=89.9, above=0.5)


def volume(mesh: VolumeMesh) -> float:
    """Of the curved elements, by a rule exact to degree 3 (their determinants are cubic)."""
    xi = np.array([[0.25] * 3, *(np.full((4, 3), 1 / 6) + np.eye(4, 3) / 3)])
    maps = np.einsum("qai,maj->mqij", shape_gradients(xi), mesh.points[mesh.tets])
    return float((np.linalg.det(maps) * [-2 / 15, *[3 / 40] * 4]).sum())


@pytest.fixture(
    scope="module",
    params=[
        (Pad("parallelepiped", rows=1, columns=2), 2.0, 1, (), 1.2),
        (Pad("hemispheric", rows=1, columns=1), 0.7, 4, (DOME,), 0.9),
    ],
    ids=lambda parameters: parameters[0].cell,
)
def both(request, pad_stl):
    """The mesh of a parametric pad and that of its surface as STL."""
    pad, source_size, cuts, rules, mesh_size = request.param
    parametric = mesh_pad(pad, source_size)
    return pad, parametric, mesh_pad_file(PadFile(pad_stl(parametric, cuts), rules), mesh_size)


@pytest.fixture
def area(facets):
    """A function that gives the area of a region's curved faces."""

    def measured(mesh: VolumeMesh, name: str) -> float:
        chosen = mesh.face_region == REGIONS[name]
        corners = facets(VolumeMesh(mesh.points, mesh.tets, mesh.faces[chosen], mesh.face_region, mesh.face_cell), 8)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return float(0.5 * np.linalg.norm(normals, axis=-1).sum())

    return measured


def test_volume_and_areas_are_those_of_the_parametric_pad(both, area):
    pad, parametric, mesh = both
    curved = pad.cell != "parallelepiped"
    assert volume(mesh) == pytest.approx(volume(parametric), rel=1e-3 if curved else 1e-7)
    # A dome of flat triangles with edges of 0.18 mm, as in the file, has 0.2 % less area than the round one.
    for name in REGIONS:
        assert area(mesh, name) == pytest.approx(area(parametric, name), rel=3e-3 if curved else 1e-7)


def test_planes_and_domes_are_met_by_every_node(both):
    pad, _, mesh = both
    nodes = {name: mesh.points[np.unique(mesh.faces[mesh.face_region == code])] for name, code in REGIONS.items()}
    assert np.all(nodes["bottom"][:, 2] == 0)
    assert np.all(nodes["top"][:, 2] == pad.height)
    along = np.abs(nodes["outer"][:, :2]) / (0.5 * np.array(pad.extent[:2]))
    np.testing.assert_allclose(along.max(axis=1), 1, atol=1e-7)
    rim = mesh.points[np.intersect1d(*(mesh.faces[mesh.face_region == REGIONS[name]] for name in ("roof", "side")))]
    np.testing.assert_allclose(rim[:, 2], pad.side_height, atol=1e-6)
    if "roof" in pad.shape.round_regions:
        distance = np.linalg.norm(nodes["roof"] - (0, 0, pad.top_of_cell - pad.shape.roof_radius), axis=1)
        np.testing.assert_allclose(distance, pad.shape.roof_radius, atol=0.005)  # the sag of the triangles of the file
    else:
        np.testing.assert_allclose(nodes["roof"][:, 2], pad.top_of_cell, atol=1e-6)


def test_the_mesh_is_one_that_mechanics_can_use(both):
    pad, _, mesh = both
    assert mesh.corner_count == np.unique(mesh.tets[:, :4]).size
    assert np.unique(mesh.tets).size == len(mesh.points)
    assert worst_element(mesh)[0] > 0.2
    assert jacobians(mesh.points, mesh.tets).min() > 0
    sides = np.sort(mesh.tets[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
    unique, counts = np.unique(sides, axis=0, return_counts=True)
    boundary = np.sort(mesh.faces[:, :3], axis=1)
    np.testing.assert_array_equal(np.unique(boundary, axis=0), unique[counts == 1])
    for elements, edges, corners in ((mesh.tets, TET_EDGES, 4), (mesh.faces, FACE_EDGES, 3)):
        ends = np.sort(elements[:, np.array(edges)], axis=2).reshape(-1, 2)
        pairs = np.unique(np.concatenate([ends, elements[:, corners:].reshape(-1, 1)], axis=1), axis=0)
        assert len(pairs) == len(np.unique(pairs[:, :2], axis=0)) == len(np.unique(pairs[:, 2]))
    a, b, c = (mesh.points[mesh.faces[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", np.cross(b - a, c - a), a) / 6 == pytest.approx(volume(mesh), rel=0.02)
    in_cell = np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))
    assert np.all((mesh.face_cell > 0) == in_cell)
    for number, centre in enumerate(pad.cell_centres, start=1):
        middle = mesh.points[np.unique(mesh.faces[mesh.face_cell == number])]
        np.testing.assert_allclose(0.5 * (middle.min(axis=0) + middle.max(axis=0))[:2], centre, atol=0.01)


def test_the_shipped_honeycomb_is_what_its_script_writes_and_has_its_areas(tmp_path, area):
    shipped = Path(hexagonal.__file__).with_name("hexagonal.stl")
    hexagonal.write(tmp_path / "again.stl")
    assert (tmp_path / "again.stl").read_bytes() == shipped.read_bytes()
    mesh = mesh_pad_file(PadFile(shipped), 1.2)
    tile, circle = 7 * hexagonal.PITCH**2 * math.sqrt(0.75), 7 * math.pi * (0.5 * hexagonal.CELL_SIZE) ** 2
    assert area(mesh, "top") == pytest.approx(tile, rel=1e-6)
    assert area(mesh, "roof") == pytest.approx(circle, rel=4e-3)  # a polygon of 48 corners has 0.3 % less
    assert area(mesh, "bottom") == pytest.approx(tile - circle, rel=4e-3)
    assert volume(mesh) == pytest.approx(tile * hexagonal.HEIGHT - circle * hexagonal.CELL_HEIGHT, rel=1e-3)
    for number, centre in enumerate(hexagonal.centres(), start=1):
        nodes = mesh.points[np.unique(mesh.faces[mesh.face_cell == number])]
        np.testing.assert_allclose(nodes[:, :2].min(axis=0) + nodes[:, :2].max(axis=0), 2 * centre, atol=0.01)


def test_the_honeycomb_s_photo_reflectors_stand_under_its_cells():
    tree = ElementTree.parse(Path(hexagonal.__file__).with_name("hexagonal.xml"))
    places = [node.get("value") for node in tree.iter("translate")]
    np.testing.assert_allclose([[float(x) for x in p.split(",")[:2]] for p in places], hexagonal.centres(), atol=1e-4)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "aarch64"), reason="the mesher's order is random there")
def test_the_same_file_gives_the_same_mesh_to_the_bit(box, write_stl, tmp_path):
    path = write_stl(tmp_path / "box.stl", box())
    one, other = (mesh_pad_file(PadFile(path), 1.0) for _ in range(2))
    for name in vars(one):
        digests = [hashlib.sha256(getattr(mesh, name).tobytes()).digest() for mesh in (one, other)]
        assert digests[0] == digests[1], name


def test_regions_may_be_parts_of_a_plane(area, box, write_stl, tmp_path):
    # The square that is loaded is cut from the top of the block by the triangles of the file alone.
    corners = box(size=(6, 6, 3), hollow=(2, 2, 1))
    square = np.array([(-1.5, -1.0, 3), (1, -1.0, 3), (1, 1.5, 3), (-1.5, 1.5, 3)])
    outline = np.array([(-3, -3, 3), (3, -3, 3), (3, 3, 3), (-3, 3, 3)], dtype=float)
    top = [square[[0, 1, 2]], square[[0, 2, 3]]]
    for k in range(4):
        m = (k + 1) % 4
        top += [np.array([outline[k], outline[m], square[k]]), np.array([outline[m], square[m], square[k]])]
    corners = np.concatenate([corners[~np.all(corners[:, :, 2] == 3, axis=1)], top])
    rule = Rule("top", normal=(0, 0, 1), box=((-1.5, -1.0, 2.9), (1, 1.5, 3.1)))
    mesh = mesh_pad_file(PadFile(write_stl(tmp_path / "patch.stl", corners), [rule]), 1.0)
    # The border is met but for its corners, which lie within an element.
    assert area(mesh, "top") == pytest.approx(6.25, rel=1e-2)
    assert area(mesh, "outer") + area(mesh, "top") == pytest.approx(4 * 6 * 3 + 36, rel=1e-6)
    rim = mesh.points[np.intersect1d(*(mesh.faces[mesh.face_region == REGIONS[name], :3] for name in ("top", "outer")))]
    off = np.abs(np.stack([rim[:, 0] + 1.5, rim[:, 0] - 1, rim[:, 1] + 1, rim[:, 1] - 1.5], axis=1)).min(axis=1)
    assert np.all(off < 1e-9)


def test_a_pad_is_known_by_content_and_rules(box, write_stl, tmp_path):
    path = write_stl(tmp_path / "a.stl", box())
    shutil.copy(path, tmp_path / "b.stl")
    pads = [PadFile(path), PadFile(str(tmp_path / "b.stl"))]
    assert pads[0] == pads[1] and hash(pads[0]) == hash(pads[1])
    assert json.dumps(pads[0].identity) == json.dumps(pads[1].identity)
    other = PadFile(path, [DOME])
    assert other != pads[0] and json.dumps(other.identity) != json.dumps(pads[0].identity)
    write_stl(path, box(size=(5, 5, 3)))
    assert PadFile(path) != pads[0]
    with pytest.raises(InputError, match="has changed"):
        mesh_pad_file(pads[0], 1.0)


@pytest.mark.parametrize("size", [0.0, -1.0, math.nan, math.inf, 1e-3])
def test_mesh_sizes_out_of_range_are_refused(size, box, write_stl, tmp_path):
    with pytest.raises(InputError, match="^mesh_size = "):
        mesh_pad_file(PadFile(write_stl(tmp_path / "box.stl", box())), size)


@pytest.mark.parametrize("name", ["nothing.stl", "pad.gltf", "pad", "."])
def test_files_that_are_not_there_or_of_no_known_format_are_refused(name, tmp_path):
    with pytest.raises(InputError, match=r"^filename = .* (is not allowed: |cannot be read \()") as caught:
        PadFile(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_file_beyond_the_limit_is_not_read(tmp_path):
    with (tmp_path / "huge.stl").open("wb") as file:
        file.truncate(2**33)
    with pytest.raises(InputError, match="8192 MB"):
        PadFile(tmp_path / "huge.stl")
