"""Pads whose cells have rounded edges: closed forms, and meshes that follow their dimensions."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.element_maps import curved_volume, worst_element
from mitsuba_taxel.geometry.surfaces.triangles import area_normals
from mitsuba_taxel.mechanics.surface.tessellation import tessellate
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.parametric.drawings import solids
from mitsuba_taxel.pads.parametric.velocities import mesh_velocity
from mitsuba_taxel.pads.regions import REGIONS

CELLS = ("parallelepiped", "cylindrical", "spherical", "frustum")


def one_cell(cell, fillet, **dimensions):
    return Pad(cell, rows=1, columns=1, fillet=fillet, **dimensions)


def hollow(cell, fillet, half=1.275, height=1.55):
    """Volume, area of the roof and area of the side of a cell: Steiner's formula, and Pappus's theorems."""
    inner, below = half - fillet, height - fillet
    quarter = 0.25 * math.pi * fillet**2
    if cell == "parallelepiped":
        section = 4 * inner**2 + 8 * inner * fillet + 4 * quarter
        around = 8 * inner + 2 * math.pi * fillet
        rim = 4 * inner**2 * fillet + 8 * inner * quarter + 2 / 3 * math.pi * fillet**3
        bands = 8 * inner * 0.5 * math.pi * fillet + 2 * math.pi * fillet**2
        return section * below + rim, 4 * inner**2, around * below + bands
    torus = 2 * math.pi * (inner + 4 * fillet / (3 * math.pi)) * quarter
    band = 2 * math.pi * (inner + 2 * fillet / math.pi) * 0.5 * math.pi * fillet
    volume = math.pi * (half**2 * below + inner**2 * fillet) + torus
    return volume, math.pi * inner**2, 2 * math.pi * half * below + band


@pytest.fixture(scope="module")
def meshes():
    pads = {(cell, fillet): one_cell(cell, fillet) for cell in CELLS for fillet in (0.1, 0.4)}
    return {key: (pad, pad.mesh(1.25)) for key, pad in pads.items()}


@pytest.mark.parametrize("fillet", [0.1, 0.4])
@pytest.mark.parametrize("cell", CELLS[:2])
def test_volume_and_areas_are_those_of_closed_forms(meshes, cell, fillet):
    pad, mesh = meshes[cell, fillet]
    volume, roof, side = hollow(cell, fillet)
    solid = solids(pad)["pad"]
    assert solid.mass == pytest.approx(math.prod(pad.extent) - volume, rel=1e-9)
    # The meshed part of it that the fillet fills.
    filled = hollow(cell, 1e-12)[0] - volume
    assert curved_volume(mesh) - math.prod(pad.extent) + volume == pytest.approx(0, abs=0.01 * filled + 2e-4 * volume)
    # Exact walls between the nodes.
    state = type("Undeformed", (), {"mesh": mesh, "displacement": np.zeros_like(mesh.points)})()
    surface = tessellate(state, 12, pad=pad)
    areas = np.linalg.norm(area_normals(surface.vertices, surface.triangles), axis=1)
    scale = areas[surface.region == REGIONS["top"]].sum() / (pad.extent[0] * pad.extent[1])
    for name, exact in (("roof", roof), ("side", side)):
        assert areas[surface.region == REGIONS[name]].sum() / scale == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("cell", CELLS)
def test_a_fillet_needs_few_elements_and_none_is_distorted(meshes, cell):
    sharp = len(one_cell(cell, 0.0).mesh(1.25).tets)
    for fillet in (0.1, 0.4):
        _, mesh = meshes[cell, fillet]
        assert len(mesh.tets) < 2.5 * sharp
        assert worst_element(mesh)[0] >= 0.2
    assert len(one_cell(cell, 0.0256).mesh(1.25).tets) < 5 * sharp


@pytest.mark.parametrize("fillet", [0.1, 0.4])
@pytest.mark.parametrize("cell", CELLS)
def test_nodes_lie_on_the_rounded_walls(meshes, cell, fillet):
    pad, mesh = meshes[cell, fillet]
    walls = mesh.points[np.unique(mesh.faces[np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))])]
    np.testing.assert_allclose(pad.edges.onto_wall(walls)[0], walls, atol=1e-9)
    assert pad.edges.holds(0.999 * walls[None] + [0, 0, 1e-9], 0.0).all()


@pytest.mark.parametrize("cell", CELLS[:2])
def test_the_volume_follows_the_radius(meshes, cell):
    pad, mesh = meshes[cell, 0.4]
    velocity, step = mesh_velocity(pad, mesh, "fillet"), 1e-4
    moved = [curved_volume(replace(mesh, points=mesh.points + sign * step * velocity)) for sign in (1, -1)]
    rate = -(hollow(cell, 0.4 + step)[0] - hollow(cell, 0.4 - step)[0]) / (2 * step)
    assert (moved[0] - moved[1]) / (2 * step) == pytest.approx(rate, rel=5e-3)


@pytest.mark.parametrize(("name", "lean"), [("fillet", 0.0), ("fillet", 0.2), ("cell_size", 0.2), ("cell_height", 0.0)])
@pytest.mark.parametrize("cell", CELLS)
def test_velocities_are_those_of_moved_meshes(cell, name, lean):
    pad = one_cell(cell, 0.2, top_x=lean)
    mesh, change = pad.mesh(2.0), 1e-5
    moved = pad.changed(**{name: pad.dimensions[name] + change}).moved_from(pad).mesh(2.0)
    velocity = mesh_velocity(pad, mesh, name)
    # The second derivative of positions jumps by 1 / fillet at the borders of a fillet.
    np.testing.assert_allclose((moved.points - mesh.points) / change, velocity, atol=1e-5 / 0.2 + 1e-6)
    assert np.abs(velocity).max() > 0.1


@pytest.mark.parametrize("cell", CELLS[:2])
@pytest.mark.parametrize(("name", "rate"), [("fillet", -1.0), ("cell_size", 0.5)])
def test_the_border_of_the_roof_moves_with_the_dimensions(meshes, cell, name, rate):
    pad, mesh = meshes[cell, 0.4]
    faces = [np.unique(mesh.faces[mesh.face_region == REGIONS[region]]) for region in ("roof", "side")]
    border = np.intersect1d(*faces)
    border = border[mesh.points[border, 1] == 0]
    velocity = mesh_velocity(pad, mesh, name)[border, 0] * np.sign(mesh.points[border, 0])
    np.testing.assert_allclose(velocity, rate, atol=1e-5)


def test_sharp_edges_have_no_derivative_by_the_radius():
    pad = one_cell("cylindrical", 0.0)
    assert "fillet" not in pad.dimensions
    with pytest.raises(InputError, match="parameter = 'fillet' is not allowed: .*fillet above 0"):
        mesh_velocity(pad, pad.mesh(2.0), "fillet")


@pytest.mark.parametrize("cell", CELLS)
def test_a_small_fillet_is_nearly_a_sharp_edge(cell):
    sharp, small = (solids(one_cell(cell, fillet))["pad"].mass for fillet in (0.0, 0.026))
    assert 0 < small - sharp < 4 * 8 * 1.55 * 0.026**2
    assert one_cell(cell, 0.0).identity == Pad(cell, rows=1, columns=1).identity


@pytest.mark.parametrize("cell", CELLS)
def test_the_mould_is_the_complement_of_the_pad(cell):
    drawn = solids(one_cell(cell, 0.3))
    base, width = drawn["mould_base"].mass, 2.55 + 2 * 1.0 + 2 * 3.0
    block = math.prod(one_cell(cell, 0.3).extent)
    assert base - 3.0 * width**2 == pytest.approx(block - drawn["pad"].mass, rel=1e-9)


def test_the_section_is_drawn_with_its_fillets():
    outline = one_cell("parallelepiped", 0.3).edges.outline()
    r, z = outline.T
    area = abs(np.trapezoid(z, r))
    assert area == pytest.approx(1.275 * 1.55 - (1 - math.pi / 4) * 0.3**2, rel=1e-4)
