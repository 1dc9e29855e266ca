"""Files as CAD programs write them: the messages name the parameters that place them."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mitsuba_taxel import InputError, PadFile
from mitsuba_taxel.check import check_scene
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.pads.imported.placement import DIRECTIONS, Placement
from mitsuba_taxel.pads.parametric.meshing import MESHING_LOCK

SCENE = """<scene version="3.9.0">
    <integrator type="taxel_tracer"/>
    <shape type="deformable_pad"> <string name="filename" value="{file}"/> {more} <float name="mesh_size" value="2"/>
        <bsdf type="region"><bsdf name="roof" type="wall"><string name="scattering" value="lambertian"/></bsdf></bsdf>
    </shape>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
    <shape type="rectangle"> <transform name="to_world"><scale value="9"/></transform> <bsdf type="wall"/> </shape>
</scene>"""
SIZE, HOLLOW = (6.0, 5.0, 4.0), (2.4, 2.2, 1.8)
TURNS = {
    "z": (), "-z": ("x", 180), "y": ("x", -90), "-y": ("x", 90), "x": ("y", 90), "-x": ("y", -90),
}  # fmt: skip
"""By direction that points up in the file, how the pad is turned there."""


def turned(points, up):
    return points @ Rotation.from_euler(*TURNS[up], degrees=True).as_matrix().T if TURNS[up] else points


def areas(mesh):
    corners = mesh.points[mesh.faces[:, :3]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.bincount(mesh.face_region, 0.5 * np.linalg.norm(normals, axis=1))


EXPECTED = {
    "roof": HOLLOW[0] * HOLLOW[1],
    "side": 2 * (HOLLOW[0] + HOLLOW[1]) * HOLLOW[2],
    "bottom": SIZE[0] * SIZE[1] - HOLLOW[0] * HOLLOW[1],
    "top": SIZE[0] * SIZE[1],
    "outer": 2 * (SIZE[0] + SIZE[1]) * SIZE[2],
}


@pytest.mark.parametrize(
    ("unit", "up", "shift"),
    [
        (1.0, "z", (10.0, 5.0, 0.0)),  # beside the packages, which only a warning says
        (1.0, "z", (0.0, 0.0, 10.0)),
        (1.0, "z", (0.0, 0.0, 0.004)),
        (1.0, "-z", (3.0, 0.0, 0.0)),
        (1.0, "y", (0.0, 0.0, 0.0)),
        (25.4, "-x", (0.0, 1.0, 2.0)),
        (1000.0, "-y", (9.0, 0.0, 0.0)),
        (1000.0, "x", (0.0, 0.0, -3.0)),
    ],
)
def test_a_file_loads_with_at_most_two_parameters_that_messages_name(tmp_path, box, write_stl, unit, up, shift):
    """Three units, six orientations, off centre, at another height, capitals: the parameter that is named is given."""
    name_of_file = "PAD.STL" if unit == 1 else "pad.stl"
    points = turned(box(SIZE, HOLLOW).reshape(-1, 3), up) + shift
    write_stl(tmp_path / name_of_file, (points / unit).reshape(-1, 3, 3))
    given = {}
    for _ in range(4):
        more = " ".join(
            f'<{kind} name="{name}" value="{given[name]}"/>'
            for name, kind in (("file_scale", "float"), ("file_up", "string"))
            if name in given
        )
        (tmp_path / "scene.xml").write_text(SCENE.format(file=name_of_file, more=more))
        wrong = [f.message for f in check_scene(tmp_path / "scene.xml") if f.severity == "error"]
        if not wrong:
            break
        (message,) = wrong
        assert "\n" not in message
        new = {
            "file_up": re.findall(r"file_up = '(-?[xyz])'", message),
            "file_scale": re.findall(r"file_scale = ([\d.]+)", message),
        }
        assert any(new[name] and name not in given for name in new), message
        name = next(name for name, values in new.items() if values and name not in given)
        given[name] = new[name][0] if name == "file_up" else f"{unit:g}"
        assert given[name] in new[name]
    assert not wrong and len(given) <= 2
    pad = PadFile(tmp_path / name_of_file, scale=float(given.get("file_scale", 1)), up=given.get("file_up", "as drawn"))
    found = areas(pad.mesh(2.0))
    for region, code in REGIONS.items():
        assert found[code] == pytest.approx(EXPECTED[region], rel=1e-4)


@pytest.mark.parametrize("up", [up for up in DIRECTIONS if up != "as drawn"])
def test_rotations_are_proper_and_bring_the_direction_up(up):
    turn = Placement(1.0, up).turn
    assert np.array_equal(turn @ turn.T, np.eye(3)) and np.linalg.det(turn) == pytest.approx(1)
    assert np.allclose(turn @ turned(np.array([0.0, 0.0, 1.0]), up), [0, 0, 1])


@pytest.mark.parametrize("up", ["-y", "x"])
def test_solids_are_placed_as_triangles_are(tmp_path, up):
    """A STEP file whose name ends in capitals, as SolidWorks writes it."""
    from netgen.occ import Axis, Box, Pnt, Vec, X, Y

    with MESHING_LOCK:
        solid = Box(Pnt(-3, -2.5, 0), Pnt(3, 2.5, 4)) - Box(Pnt(-1.2, -1.1, -1), Pnt(1.2, 1.1, 1.8))
        word, angle = TURNS[up]
        solid = solid.Rotate(Axis(Pnt(0, 0, 0), {"x": X, "y": Y}[word]), angle).Move(Vec(4, 5, 6))
        solid.WriteStep(str(tmp_path / "pad.step"))
    file = (tmp_path / "pad.step").rename(tmp_path / "PAD.STEP")
    with pytest.raises(InputError, match=f"file_up = '{up}' stands it on the board"):
        PadFile(file).mesh(2.0)
    mesh = PadFile(file, up=up).mesh(2.0)
    found = areas(mesh)
    for region, code in REGIONS.items():
        assert found[code] == pytest.approx(EXPECTED[region], rel=1e-9)
    assert mesh.points[:, 2].min() == 0
    twice = PadFile(file, up=up, scale=2.0).mesh(4.0)
    assert np.ptp(twice.points, axis=0) == pytest.approx(2 * np.array(SIZE), rel=1e-9)
    assert PadFile(file, up=up) != PadFile(file) and PadFile(file, up=up).identity != PadFile(file).identity


def test_a_body_in_metres_is_refused_with_its_size_and_the_parameter(tmp_path, box, write_stl):
    corners = box((160.0, 40.0, 20.0), (80.0, 20.0, 10.0))
    file = write_stl(tmp_path / "body.stl", corners / 1000)
    said = "0.16 x 0.04 x 0.02 mm is too small a body for a depth of 0.5 mm .* in m, indenter_file_scale = 1000 makes"
    with pytest.raises(InputError, match=said):
        Indenter(file=file).body.distance_to_steepest_pressure(np.zeros((1, 3)), 0.5)
    size = np.ptp(Indenter(file=file, file_scale=1000.0).body.solid.vertices, axis=0)
    assert size == pytest.approx([160, 40, 20], rel=1e-6)
    upright = Indenter(file=file, file_scale=1000.0, file_up="x").body.solid.vertices
    assert np.ptp(upright, axis=0) == pytest.approx([20, 40, 160], rel=1e-6)
    assert upright.min(axis=0) == pytest.approx([-10, -20, 0], abs=1e-4)


def test_a_pad_drawn_from_a_corner_is_refused_with_its_size_its_cells_and_the_move(tmp_path, box, write_stl):
    write_stl(tmp_path / "pad.stl", box(SIZE, HOLLOW) + [2.0, 2.5, 0.0])
    (tmp_path / "scene.xml").write_text(SCENE.format(file="pad.stl", more=""))
    (message,) = [f.message for f in check_scene(tmp_path / "scene.xml") if f.severity == "error"]
    assert "the pad is 6 x 5 x 4 mm, with cells at (2, 2.5) mm; file_up = 'z' centres it, from (2, 2.5)" in message
