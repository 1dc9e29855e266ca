"""A pad from a STEP file."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.element_maps import jacobians
from mitsuba_taxel.mechanics import tessellate
from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.pads.imported.rules import Rule
from mitsuba_taxel.pads.pad_file import PadFile, mesh_pad_file
from mitsuba_taxel.pads.parametric.meshing import MESHING_LOCK

RADIUS = 1.2


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    """A block of 8 x 4 x 4 mm with two hemispheric cells of 0.5 mm side wall; faces below z = 0.6 are named."""
    from netgen.occ import Box, Cylinder, Pnt, Sphere, Z

    with MESHING_LOCK:
        solid = Box(Pnt(-4, -2, 0), Pnt(4, 2, 4))
        for x in (-2, 2):
            above = Box(Pnt(x - 2, -2, 0.5), Pnt(x + 2, 2, 3))
            dome = Sphere(Pnt(x, 0, 0.5), RADIUS) * above
            dome.faces.name = "dome"
            shaft = Cylinder(Pnt(x, 0, -1), Z, RADIUS, 1.5)
            shaft.faces.name = "shaft"
            solid = solid - (shaft + dome)
        path = tmp_path_factory.mktemp("step") / "pad.step"
        solid.WriteStep(str(path))
    return path


@pytest.fixture(scope="module")
def mesh(step):
    return mesh_pad_file(PadFile(step), 0.5)


@pytest.fixture
def areas(facets):
    """A function that gives the area of each region's curved faces."""

    def measured(mesh):
        triangles = facets(mesh, 6)
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        size = 0.5 * np.linalg.norm(normals, axis=1).reshape(len(mesh.faces), -1).sum(axis=1)
        return {name: size[mesh.face_region == code].sum() for name, code in REGIONS.items()}

    return measured


CIRCLE = math.pi * RADIUS**2
AREAS = {"roof": 4 * CIRCLE, "side": 2 * math.pi * RADIUS, "bottom": 32 - 2 * CIRCLE, "top": 32, "outer": 96}


def test_regions_and_cells_are_guessed_by_whole_faces(mesh, areas):
    assert areas(mesh) == pytest.approx(AREAS, rel=2e-3)
    for number, x in ((1, -2), (2, 2)):
        nodes = mesh.points[np.unique(mesh.faces[mesh.face_cell == number])]
        np.testing.assert_allclose(0.5 * (nodes[:, 0].min() + nodes[:, 0].max()), x, atol=0.01)


def test_nodes_lie_on_the_faces_of_the_solid(mesh):
    nodes = {name: mesh.points[np.unique(mesh.faces[mesh.face_region == code])] for name, code in REGIONS.items()}
    np.testing.assert_allclose(nodes["bottom"][:, 2], 0, atol=1e-9)
    np.testing.assert_allclose(nodes["top"][:, 2], 4, atol=1e-9)
    centre = np.where(nodes["roof"][:, :1] < 0, (-2, 0, 0.5), (2, 0, 0.5))
    np.testing.assert_allclose(np.linalg.norm(nodes["roof"] - centre, axis=1), RADIUS, atol=1e-6)
    assert jacobians(mesh.points, mesh.tets).min() > 0.2
    assert mesh.corner_count == np.unique(mesh.tets[:, :4]).size
    middle = mesh.points[mesh.tets[:, :2]].mean(axis=1)
    assert np.linalg.norm(mesh.points[mesh.tets[:, 4]] - middle, axis=1).max() < 0.3


def test_faces_are_known_by_name(step, areas):
    named = mesh_pad_file(PadFile(step, [Rule("outer", face="shaft"), Rule("roof", face="dome")]), 0.7)
    expected = AREAS | {"side": 0.0, "outer": AREAS["outer"] + AREAS["side"]}
    assert areas(named) == pytest.approx(expected, rel=2e-3)
    roof = named.face_region == REGIONS["roof"]
    x = named.points[named.faces[roof, :3], 0].mean(axis=1)
    np.testing.assert_array_equal(named.face_cell[roof], np.where(x < 0, 1, 2))
    assert not named.face_cell[~roof].any()


def test_a_name_that_no_face_has_is_refused_with_those_there_are(step):
    with pytest.raises(InputError, match=r"^filename = .*pad.step is not allowed: a rule names the face 'lid'.*dome"):
        mesh_pad_file(PadFile(step, [Rule("roof", face="lid")]), 1.25)


def test_a_mesh_too_fine_is_refused_before_it_is_made(step):
    with pytest.raises(InputError, match="^mesh_size = "):
        mesh_pad_file(PadFile(step), 1e-3)


@pytest.mark.parametrize("content", [b"", b"ISO-10303-21;\nHEADER;\nENDSEC;\n", bytes(range(256)) * 20])
def test_what_is_no_step_file_is_refused_in_one_line(tmp_path, capfd, content):
    (tmp_path / "pad.stp").write_bytes(content)
    with pytest.raises(InputError, match="^filename = .*pad.stp is not allowed") as caught:
        mesh_pad_file(PadFile(tmp_path / "pad.stp"), 1.25)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_two_solids_are_refused(tmp_path):
    from netgen.occ import Box, Compound, Pnt

    with MESHING_LOCK:
        Compound([Box(Pnt(0, 0, 0), Pnt(1, 1, 1)), Box(Pnt(3, 0, 0), Pnt(4, 1, 1))]).WriteStep(str(tmp_path / "a.step"))
    with pytest.raises(InputError, match="2 solids"):
        mesh_pad_file(PadFile(tmp_path / "a.step"), 1.25)


def test_light_meets_the_spheres_and_cylinders_that_cells_are(step, mesh):
    """Between the nodes elements have parabolas, which are off them."""
    rest = SimpleNamespace(mesh=mesh, displacement=np.zeros_like(mesh.points))
    for pad, bounds in ((PadFile(step), (-1, 1e-9)), (None, (1e-6, 1e-2))):
        surface = tessellate(rest, 4, pad=pad)
        centre = np.array([[-2, 0, 0.5], [2, 0, 0.5]])[surface.cell - 1]
        for name, axes in (("roof", 3), ("side", 2)):
            here = surface.region == REGIONS[name]
            from_centre = (surface.vertices[surface.triangles[here]] - centre[here][:, None])[..., :axes]
            distance = np.linalg.norm(from_centre, axis=2, keepdims=True)
            assert bounds[0] < np.abs(distance / RADIUS - 1).max() < bounds[1]
            if pad is not None:
                along = np.einsum("tki,tki->tk", from_centre / distance, surface.normals[here][..., :axes])
                np.testing.assert_allclose(along, -1, atol=1e-9)
