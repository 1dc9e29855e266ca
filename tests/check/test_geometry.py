"""Parts that are misplaced are found, at their place, and what is just right is left in peace."""

from __future__ import annotations

import re

import pytest
import trimesh
from flawed_scene import AT_END, IN_PAD, IN_REFLECTOR, PACKAGE, PAD, PLATE, change, check, parameter

from mitsuba_taxel import Pad, PadSensor, check_scene, write_xml

pytestmark = pytest.mark.usefixtures("static")

TO_BOARD = ('<scale value="10"/>', '<scale value="10"/> <translate z="{}"/>')


TO_REFLECTOR = ("<emitter type=", '<transform name="to_world"> <translate x="{}"/> </transform> <emitter type=')


CUBE = """<shape type="cube"> <transform name="to_world"> <scale value="0.2"/> <translate x="-0.45" z="{}"/>
</transform> <bsdf type="wall"/> </shape>"""


ON_BOARD = """<shape type="rectangle"> <transform name="to_world"> <scale value="0.2"/> {turn}
<translate x="1" z="0.2"/> </transform> <emitter type="annular_led"/> <bsdf type="wall"/> </shape>
<shape type="rectangle"> <transform name="to_world"> <scale value="0.4"/> <translate x="1" y="0.7" z="0.2"/>
</transform> <sensor type="phototransistor"/> <bsdf type="wall"/> </shape>"""


DOWN = '<rotate x="1" angle="180"/> <scale value="0.2"/>'


GEOMETRY = {
    "gap over the board": (PAD, TO_BOARD, "-0.1", "-0.0005", "warning", 19, "lies 0.1 mm below the bottom of the pad"),
    "board in the pad": (PAD, TO_BOARD, "0.1", "0.0005", "warning", 19, "lies 0.1 mm above the bottom of the pad"),
    "board over the LEDs": (PAD, TO_BOARD, "0.6", "0", "warning", 14, "annular_led lies under the board"),
    "package too wide": (PAD, IN_REFLECTOR, parameter("body", "2.6, 1.06, 0.5", "vector"),
                         parameter("body", "2.2, 1.06, 0.5", "vector"), "error", 12, "2.6 x 1.06 x 0.5 mm, stands in"),
    "package too high": (PAD, IN_REFLECTOR, parameter("body", "1.46, 1.06, 1.6", "vector"),
                         parameter("body", "1.46, 1.06, 1.5", "vector"), "error", 12, "1.55 mm high"),
    "package off its cell": (PAD, TO_REFLECTOR, "0.7", "0.3", "error", 12, "package 1 of photo_reflector"),
    "package beside the pad": (PAD, TO_REFLECTOR, "40", "0", "warning", 12, "9 of 9 packages of photo_reflector"),
    "other rows": (PAD, ('name="rows" value="3"', 'name="rows" value="{}"'), "2", "1", "error", 12,
                   "2 x 3 at 3.55 mm, that of the cells 3 x 3"),
    "other pitch": (PAD, IN_REFLECTOR, parameter("pitch", 3.6), parameter("pitch", 3.55), "warning", 14,
                    "pitch = 3.6 of photo_reflector is not that"),
    "cells that are not read": (PAD, IN_PAD, parameter("read_cells", "1, 2, 3, 4, 6, 7, 8, 9", "string"),
                                parameter("read_cells", "1 2 3 4 5 6 7 8 9", "string"), "warning", 8, "out cell 5"),
    "LED looking away": (PLATE, ('<scale value="0.2"/>', "{}"), DOWN, '<scale value="0.2"/>', "warning", 6,
                         "nothing lies in front of the annular_led"),
    "phototransistor looking away": (PLATE, ('<scale value="0.4"/>', "{}"), DOWN.replace("0.2", "0.4"),
                                     '<scale value="0.4"/>', "warning", 11, "in front of the phototransistor"),
    "LED in a body": (PLATE, AT_END, CUBE.format(0), CUBE.format(-0.3), "warning", 6,
                      "lies inside the cube of line 22"),
    "LED in the face of a body": (PLATE, AT_END, CUBE.format(-0.2), CUBE.format(-0.21), "error", 6,
                                  "the cube .* lies in its plane and overlaps it"),
    "LED on a body, looking into it": (PLATE, AT_END, CUBE.format(0.2), CUBE.format(0.22), "warning", 6,
                                       "lies on the cube of line 22 and looks into it"),
    "LED and phototransistor overlapping": (PLATE, ('x="-0.45"', 'x="{}"'), "0.3", "-0.45", "error", 6,
                                            "lies in its plane and overlaps it"),
    "LED wider than its rectangle": (PLATE, ('value="0.2"', 'value="{}"'), "0.1", "0.13", "error", 6,
                                     "^annular_led: 0.25 x 0.25 mm do not fit on its rectangle, 0.2 x 0.2 mm"),
    "LED looking at the board": (PAD, AT_END, ON_BOARD.format(turn='<rotate x="1" angle="180"/>'),
                                 ON_BOARD.format(turn=""), "warning", 24, "looks at the board .* not at the roof"),
    "packages on each other": (PAD, AT_END, PACKAGE.format(0), "",
                               "error", 14, "the photo_reflector .* lies in its plane and overlaps it"),
    "far from the origin": (PLATE, ("<scene", "{}<scene"), "3000", "200", "error", 6, "3e.03 mm from the origin"),
}  # fmt: skip


@pytest.mark.parametrize("text, place, wrong, right, severity, line, message", GEOMETRY.values(), ids=GEOMETRY.keys())
def test_geometry(tmp_path, text, place, wrong, right, severity, line, message):
    def said_of(content):
        if place[0] == "<scene":
            return check(tmp_path, text.replace("</transform>", f'<translate y="{content}"/> </transform>'))
        return check(tmp_path, change(text, place, content))

    assert any(
        (found.severity, found.line) == (severity, line) and re.search(message, found.message)
        for found in said_of(wrong)
    ), said_of(wrong)
    assert said_of(right) == []


@pytest.mark.parametrize(("rim", "count"), [(0.8, 0), (0.5, 1)])
def test_a_package_may_stand_in_the_silicone_beside_a_tapered_side(tmp_path, llvm_mono, rim, count):
    """Its corner is 0.9 mm off the axis, 0.5 mm high, where the side is 1.04 mm or 0.68 mm off."""
    sensor = PadSensor(pad=Pad("profile", 1, 1, profile=f"{rim} 0.35; 0.3 1; 0 1"))
    write_xml(sensor.scene(), tmp_path / "scene.xml")
    assert len([one for one in check_scene(tmp_path / "scene.xml") if "stands in the silicone" in one.message]) == count


@pytest.mark.parametrize("x, message", [("-9", "the indenter does not touch it"), ("-5", None)])
def test_an_indenter_beside_the_pad(tmp_path, x, message):
    load = parameter("load", "indenter_displacement", "string") + parameter("indenter_radius", 2)
    text = PAD.replace('<vector name="force" value="0, 0, $fz"/>', load + parameter("indenter_x", x))
    text = change(text, IN_PAD, parameter("displacement", "0.1, 0, -0.5", "vector"))
    found = check(tmp_path, text.replace('<default name="fz" value="-5"/>', ""))
    assert [finding.severity for finding in found] == ["warning"] * (message is not None)
    assert message is None or message in found[0].message


@pytest.mark.parametrize("radius, depth", [(2, -5), (0.01, -5), (3, -4.5)])
def test_an_indenter_that_is_pushed_in_whole_touches_the_pad(tmp_path, radius, depth):
    load = parameter("load", "indenter_displacement", "string") + parameter("indenter_radius", radius)
    text = PAD.replace('<vector name="force" value="0, 0, $fz"/>', load)
    text = change(text, IN_PAD, parameter("displacement", f"0, 0, {depth}", "vector"))
    found = check(tmp_path, text.replace('<default name="fz" value="-5"/>', ""))
    assert not [finding for finding in found if "does not touch" in finding.message]


def test_no_board_is_worth_a_note(tmp_path):
    (finding,) = check(tmp_path, PAD.split('<shape type="rectangle">')[0] + "</scene>")
    assert (finding.severity, finding.line) == ("note", 4) and "there is no board" in finding.message


def write_pad(path, x):
    """A pad of 8 x 4 x 4 mm with one cell of 2 x 2 x 2 mm at x = 2 mm of its own, all of it moved along x."""
    from mitsuba_taxel.pads.parametric.meshing import MESHING_LOCK

    if path.suffix == ".step":
        from netgen.occ import Box, Pnt

        with MESHING_LOCK:
            hollow = Box(Pnt(x + 1, -1, -1), Pnt(x + 3, 1, 2))
            (Box(Pnt(x - 4, -2, 0), Pnt(x + 4, 2, 4)) - hollow).WriteStep(str(path))
        return
    mesh = Pad(rows=1, columns=1, wall=1.0, cell_size=2.0, cell_height=1.5).mesh(2.5)
    places = mesh.points + [x + 2, 0, 0]
    trimesh.Trimesh(places, mesh.faces[:, :3], process=False).export(path)


@pytest.mark.parametrize("suffix", [".stl", ".step"])
@pytest.mark.parametrize("x, beside", [(0.0, 0), (10.0, 1), (-4.0, 1)])
def test_packages_beside_the_cells_of_a_file(tmp_path, suffix, x, beside):
    """As of built-in pads; before, a pad drawn off its packages read 0 W without a word. At -4 mm, they stand in the
    place of a cell of the mirrored pad."""
    write_pad(tmp_path / f"pad{suffix}", x)
    text = f"""<scene version="3.9.0">
<integrator type="taxel_tracer"/>
<shape type="deformable_pad"> <string name="filename" value="pad{suffix}"/> <float name="mesh_size" value="3"/>
<bsdf type="region"> <bsdf name="roof" type="wall"/> </bsdf> </shape>
<shape type="photo_reflector"> <transform name="to_world"> <translate x="2"/> </transform>
<emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
<shape type="rectangle"> <transform name="to_world"> <scale value="30"/> </transform> <bsdf type="wall"/> </shape>
</scene>"""
    findings = [finding for finding in check(tmp_path, text) if finding.severity != "note"]
    said = "1 of 1 packages of photo_reflector stand beside the deformable_pad, in no cell"
    assert [(f.severity, f.line) for f in findings] == [("warning", 5)] * beside
    assert all(f.message.startswith(said) for f in findings)
    where = f"the pad is 8 x 4 x 4 mm, with cells at ({x + 2:g}, 0) mm; file_up = 'z' centres it, from ({x:g}, 0)"
    assert suffix == ".stl" or all(where in f.message for f in findings)
