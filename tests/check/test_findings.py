"""Each flaw of a scene is found, at its place, and what is just right is left in peace."""

from __future__ import annotations

import re

import numpy as np
import pytest
import trimesh

from mitsuba_taxel import InputError, Pad, PadSensor, check_scene, write_template, write_xml
from mitsuba_taxel.sensing.scene import shipped_scenes

PAD = """<scene version="3.9.0">
<default name="fz" value="-5"/>
<integrator type="taxel_tracer"/>
<shape type="deformable_pad">
  <string name="cell" value="cylindrical"/>
  <float name="youngs_modulus" value="4.16"/>
  <vector name="force" value="0, 0, $fz"/>
  <bsdf type="region">
    <bsdf name="roof" type="wall"> <float name="reflectance" value="0.9"/> </bsdf>
  </bsdf>
</shape>
<shape type="photo_reflector">
  <integer name="rows" value="3"/> <integer name="columns" value="3"/>
  <emitter type="annular_led">
  </emitter>
  <sensor type="phototransistor">
  </sensor>
</shape>
<shape type="rectangle">
  <transform name="to_world"> <scale value="10"/> </transform>
  <bsdf type="wall"> <string name="scattering" value="absorbing"/> </bsdf>
</shape>
</scene>"""

PLATE = """<scene version="3.9.0">
<default name="z" value="0.7"/>
<integrator type="taxel_tracer"/>
<shape type="rectangle" id="led">
  <transform name="to_world"> <scale value="0.2"/> <translate x="-0.45"/> </transform>
  <emitter type="annular_led"/>
  <bsdf type="wall"> <string name="scattering" value="absorbing"/> </bsdf>
</shape>
<shape type="rectangle" id="phototransistor">
  <transform name="to_world"> <scale value="0.4"/> <translate x="0.45"/> </transform>
  <sensor type="phototransistor"> <film type="hdrfilm"> <integer name="width" value="1"/>
    <integer name="height" value="1"/> <rfilter type="box"/> <string name="pixel_format" value="luminance"/> </film>
    <sampler type="owen_sobol"/> </sensor>
  <bsdf type="wall"> <string name="scattering" value="absorbing"/> </bsdf>
</shape>
<shape type="rectangle" id="plate">
  <transform name="to_world"> <rotate x="1" angle="180"/> <scale value="4"/> <translate z="$z"/> </transform>
  <bsdf type="wall">
    <string name="scattering" value="mirror"/>
  </bsdf>
</shape>
</scene>"""

IN_PAD = ("<bsdf type=", "{}<bsdf type=")
IN_REFLECTOR = ("<emitter type=", "{}<emitter type=")
IN_LED = ("  </emitter>", "{}  </emitter>")
IN_SENSOR = ("  </sensor>", "{}  </sensor>")
TO_BOARD = ('<scale value="10"/>', '<scale value="10"/> <translate z="{}"/>')
AT_END = ("</scene>", "{}</scene>")
CUBE = """<shape type="cube"> <transform name="to_world"> <scale value="0.2"/> <translate x="-0.45" z="{}"/>
</transform> <bsdf type="wall"/> </shape>"""
PAD_ALONE = '<shape type="deformable_pad"/>'
ON_BOARD = """<shape type="rectangle"> <transform name="to_world"> <scale value="0.2"/> {turn}
<translate x="1" z="0.2"/> </transform> <emitter type="annular_led"/> <bsdf type="wall"/> </shape>
<shape type="rectangle"> <transform name="to_world"> <scale value="0.4"/> <translate x="1" y="0.7" z="0.2"/>
</transform> <sensor type="phototransistor"/> <bsdf type="wall"/> </shape>"""
PACKAGE = """<shape type="photo_reflector"> <transform name="to_world"> <translate x="{}"/> </transform>
<emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>"""
DOWN = '<rotate x="1" angle="180"/> <scale value="0.2"/>'


@pytest.fixture(autouse=True)
def static(monkeypatch):
    """What is found without deforming pads: the rest is in tests/properties/test_check_and_measure.py."""
    monkeypatch.setattr("mitsuba_taxel.check.scene.check_prepared", lambda scene, file: [])


def change(text: str, place: tuple[str, str], content: str) -> str:
    assert place[0] in text
    return text.replace(place[0], place[1].format(content), 1)


def check(tmp_path, text: str, **parameters):
    file = tmp_path / "scene.xml"
    file.write_text(text)
    return check_scene(file, **parameters)


def parameter(name: str, value: object, tag: str = "float") -> str:
    return f'<{tag} name="{name}" value="{value}"/>'


@pytest.mark.parametrize("text", [PAD, PLATE], ids=["pad", "plate"])
def test_a_sound_scene_has_no_findings(tmp_path, text):
    assert check(tmp_path, text) == []


@pytest.mark.parametrize("cell", ["parallelepiped", "spherical", "hemispheric", "profile"])
def test_a_sensor_made_in_python_has_none(tmp_path, llvm_mono, cell):
    pad = Pad("spherical", 2, 1).as_profile() if cell == "profile" else Pad(cell, rows=2, columns=1)
    sensor = PadSensor(pad=pad, force=(0.1, 0, -2))
    write_xml(sensor.scene(), tmp_path / "scene.xml")
    assert check_scene(tmp_path / "scene.xml") == []


@pytest.mark.parametrize(("rim", "count"), [(0.8, 0), (0.5, 1)])
def test_a_package_may_stand_in_the_silicone_beside_a_tapered_side(tmp_path, llvm_mono, rim, count):
    """Its corner is 0.9 mm off the axis, 0.5 mm high, where the side is 1.04 mm or 0.68 mm off."""
    sensor = PadSensor(pad=Pad("profile", 1, 1, profile=f"{rim} 0.35; 0.3 1; 0 1"))
    write_xml(sensor.scene(), tmp_path / "scene.xml")
    assert len([one for one in check_scene(tmp_path / "scene.xml") if "stands in the silicone" in one.message]) == count


@pytest.mark.parametrize("name", sorted(file.name for file in shipped_scenes().glob("*.xml")))
def test_shipped_scenes_have_none(name):
    assert check_scene(name) == []


@pytest.mark.parametrize("kind", ["scene", "touch"])
def test_the_templates_have_none(tmp_path, kind):
    write_template(kind, tmp_path / "scene.xml")
    assert check_scene(tmp_path / "scene.xml") == []


NAMES = {
    "misspelt parameter": (PAD, ("youngs_modulus", "young_modulus{}"), "", 6, "did you mean youngs_modulus"),
    "parameter of another plugin": (PAD, IN_LED, parameter("pitch", 4), 15, "pitch is no parameter of annular_led"),
    "misspelt plugin": (PAD, ("annular_led", "anular_led{}"), "", 14, "'anular_led' is not a plugin .*annular_led"),
    "misspelt plugin of Mitsuba": (PLATE, ("hdrfilm", "hdfilm{}"), "", 11, "'hdfilm' is not a plugin .*hdrfilm"),
    "plugin of another kind": (PAD, ("annular_led", "wall{}"), "", 14, "wall is a plugin for <bsdf>, not"),
    "Mitsuba's plugin of another kind": (PLATE, ("hdrfilm", "box{}"), "", 11, "box is a plugin for <rfilter>"),
    "misspelt element": (PAD, ('<vector name="force"', '<vectr{} name="force"'), "", 7, "<vectr> is no .*vector"),
    "element of another type": (PAD, ("integer", "float{}"), "", 13, "rows of photo_reflector stands in a <float>"),
    "name without value": (PAD, ("$fz", "$fx{}"), "", 7, r"\$fx has no value"),
    "parameter of Mitsuba's": (
        PLATE, ('<emitter type="annular_led"/>', '{}<emitter type="annular_led"/>'), parameter("size", 1), 6,
        "size is no parameter of rectangle",
    ),
    "parameter without meaning": (PAD, IN_PAD, parameter("layer_height", 0.1), 8, "layer_height is not allowed for"),
    "value out of range": (PAD, ("0.9", "1.9{}"), "", 9, "reflectance = 1.9 is not allowed"),
    "value out of a list": (PAD, ("cylindrical", "round{}"), "", 5, "cell = 'round' is not allowed: one of"),
    "no number": (PAD, ('"4.16"', '"stiff{}"'), "", 6, 'could not parse floating point value "stiff"'),
    "not finite": (PAD, ('"4.16"', '"nan{}"'), "", 6, "youngs_modulus = nan"),
    "no such region": (PAD, ('"roof"', '"ceiling{}"'), "", 9, "'ceiling' is not a region"),
    "no such file": (
        PAD, IN_LED, parameter("law", "tabulated", "string") + parameter("file", "no.csv", "string"), 15, "no.csv",
    ),
    "no such id": (PLATE, AT_END, '<shape type="instance"> <ref id="nothing"/> </shape>', 22, "nothing"),
    "a place that is none": (PLATE, ('value="0.7"', 'value="nan{}"'), "", 17, "to_world of rectangle is not allowed"),
    "rfilter": (PLATE, ('<rfilter type="box"/>', '{}'), "", 11, "rfilter must be a box"),
    "a cell that is none": (PAD, IN_PAD, parameter("read_cells", "1, 10", "string"), 8, "read_cells = 10 is not"),
    "a finish on some cells": (
        PAD, IN_PAD, parameter("read_cells", 1, "string") + parameter("finish", "layer_steps", "string")
        + parameter("layer_height", 0.1), 8, "read_cells is not allowed with a finish",
    ),
    "given twice": (PAD, IN_PAD, parameter("youngs_modulus", 4.2), 8, "youngs_modulus is given twice"),
    "a word with no value": (PAD, ('name="cell" value="cylindrical"', 'name="cell"{}'), "", 5, "missing required attr"),
    "a pad in a package": (
        PLATE, ('<emitter type="annular_led"/>', '{}<emitter type="annular_led"/>'), PAD_ALONE, 6,
        "deformable_pad stands in a rectangle",
    ),
    "two integrators": (PAD, AT_END, '<integrator type="taxel_path"/>', 23, "takes one integrator"),
    "a second wall in an LED": (PAD, IN_LED, '<bsdf type="wall"/>', 15, "annular_led has no use for the <bsdf>"),
}  # fmt: skip


@pytest.mark.parametrize("text, place, content, line, message", NAMES.values(), ids=NAMES.keys())
def test_what_a_plugin_or_mitsuba_refuses(tmp_path, text, place, content, line, message):
    (finding,) = check(tmp_path, change(text, place, content))
    assert (finding.severity, finding.file, finding.line) == ("error", "scene.xml", line)
    assert re.search(message, finding.message), finding.message


def test_all_that_is_wrong_is_listed(tmp_path):
    """Misspelt names, values out of range, several in one plugin, beside what Mitsuba itself does not parse."""
    text = change(PAD, ('"4.16"', '"-4"{}'), "").replace("cylindrical", "round").replace('"3"', '"0"')
    text = change(text, IN_LED, parameter("power", -1) + parameter("hole", 1) + parameter("colour", 3))
    said = [(finding.line, finding.message.split(" ")[0]) for finding in check(tmp_path, text)]
    assert sorted(said) == [(5, "cell"), (6, "youngs_modulus"), (13, "columns"), (13, "rows"), (15, "colour"),
                            (15, "hole"), (15, "power")]  # fmt: skip
    unparsed = check(tmp_path, change(text, ('"0.9"', '"much"{}'), "").replace('"-4"', '"stiff"'))
    said = [(finding.line, finding.message.split(" ")[0]) for finding in unparsed]
    assert said == [(6, "youngs_modulus:"), (9, "reflectance:"), (15, "colour")]


UNITS = {
    "pad in m": (PAD, IN_PAD, "cell_height", 0.00155, 0.06, "warning", r"odd: .* if it is in m, write 1.55"),
    "height in µm": (PAD, IN_PAD, "height", 4550, 150, "warning", "if it is in µm, write 4.55"),
    "mesh size in m": (PAD, IN_PAD, "mesh_size", 0.00125, 0.5, "warning", "mesh_size .* in m, write 1.25"),
    "LED in m": (PAD, IN_LED, "size", 0.00025, 0.2, "error", "hole = 0.1 is not allowed"),
    "modulus in Pa": (PAD, ('"4.16"', '"{}"'), None, 4.16e6, 9.9, "warning", "in Pa, write 4.16"),
    "modulus in kPa": (PAD, ('"4.16"', '"{}"'), None, 4160, 99, "warning", "in kPa, write 4.16"),
    "modulus in GPa": (PAD, ('"4.16"', '"{}"'), None, 0.00416, 0.006, "warning", "in GPa, write 4.16"),
    "wavelength in µm": (PAD, IN_LED, "wavelength", 0.925, 250, "warning", "in µm, write 925"),
    "wavelength in m": (PAD, IN_LED, "wavelength", 9.25e-7, 1550, "warning", "in m, write 925"),
    "cone in radians": (PAD, IN_LED, "cone_angle", 1.05, 1.6, "warning", "in radians, write 60.16"),
    "force in mN": (PAD, ('"-5"', '"{}"'), None, -5000, -1000, "warning", "if it is in mN, write it in N"),
    "force in kN": (PAD, ('"-5"', '"{}"'), None, -0.005, -0.02, "warning", "if it is in kN, write it in N"),
    "a pull": (PAD, ('"-5"', '"{}"'), None, 5, 0, "warning", "pulls at the pad: compression is negative"),
}  # fmt: skip


@pytest.mark.parametrize("text, place, name, wrong, right, severity, message", UNITS.values(), ids=UNITS.keys())
def test_units(tmp_path, text, place, name, wrong, right, severity, message):
    def said_of(value):
        return check(tmp_path, change(text, place, value if name is None else parameter(name, value)))

    (finding,) = (found for found in said_of(wrong) if re.search(message, found.message))
    assert finding.severity == severity and finding.line > 1
    assert not [found for found in said_of(right) if "odd" in found.message or re.search(message, found.message)]


def test_a_load_is_not_judged_by_an_odd_modulus(tmp_path):
    (finding,) = check(tmp_path, PAD.replace("4.16", "4.16e6"))
    assert "youngs_modulus" in finding.message


@pytest.mark.parametrize(
    "load, message",
    [
        (("plate_displacement", "vector", "displacement", "0, 0, 0.5"), "pulls at the pad"),
        (("plate_displacement", "vector", "displacement", "0, 0, -500"), "more than the height of the pad, 4.55 mm"),
        (("pressure", "float", "pressure", "-0.1"), "suction"),
        (("pressure", "float", "pressure", "20000"), "if it is in Pa or kPa"),
        (("plate_displacement", "vector", "displacement", "0, 0, -0.5"), None),
        (("pressure", "float", "pressure", "0.1"), None),
    ],
)
def test_other_loads(tmp_path, load, message):
    name, tag, quantity, value = load
    text = PAD.replace('<vector name="force" value="0, 0, $fz"/>', parameter("load", name, "string"))
    text = change(text, IN_PAD, parameter(quantity, value, tag)).replace('<default name="fz" value="-5"/>', "")
    found = check(tmp_path, text)
    assert [finding.severity for finding in found] == ["warning"] * (message is not None)
    assert message is None or message in found[0].message


@pytest.mark.parametrize("removed, culprit", [(0, None), (1, "indenter_file = .*body.stl is not allowed: .*open")])
def test_an_indenter_of_ones_own(tmp_path, removed, culprit):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=2.0)
    ball.update_faces(np.arange(len(ball.faces)) >= 20 * removed)
    ball.export(tmp_path / "body.stl")
    load = parameter("load", "indenter_displacement", "string") + parameter("indenter", "file", "string")
    load += parameter("indenter_file", "body.stl", "string")
    load += '<vector name="displacement" value="0, 0, $fz"/>'
    text = PAD.replace('<vector name="force" value="0, 0, $fz"/>', load).replace('"-5"', '"-1"')
    (tmp_path / "scene.xml").write_text(text)
    found = check_scene(tmp_path / "scene.xml")
    assert [re.search(culprit or "", finding.message) is not None for finding in found] == [True] * removed


@pytest.mark.parametrize("x, message", [("-9", "the indenter does not touch it"), ("-5", None)])
def test_an_indenter_beside_the_pad(tmp_path, x, message):
    load = parameter("load", "indenter_displacement", "string") + parameter("indenter_radius", 2)
    text = PAD.replace('<vector name="force" value="0, 0, $fz"/>', load + parameter("indenter_x", x))
    text = change(text, IN_PAD, parameter("displacement", "0.1, 0, -0.5", "vector"))
    found = check(tmp_path, text.replace('<default name="fz" value="-5"/>', ""))
    assert [finding.severity for finding in found] == ["warning"] * (message is not None)
    assert message is None or message in found[0].message


def test_a_wall_given_twice_is_odd(tmp_path):
    (finding,) = check(tmp_path, change(PAD, ("  </bsdf>", "{}  </bsdf>"), '<bsdf name="roof" type="wall"/>'))
    assert (finding.severity, finding.line) == ("warning", 10) and "roof is given twice" in finding.message


def test_a_photo_reflector_in_metres(tmp_path):
    """Each length is odd, and says what it would be in mm."""
    lengths = parameter("body", "0.00146, 0.00106, 0.0005", "vector") + parameter("spacing", 0.0009)
    text = change(PAD, IN_LED, parameter("size", 0.00025) + parameter("hole", 0.0001))
    text = change(
        change(text, IN_SENSOR, parameter("width", 0.00052) + parameter("depth", 0.0003)), IN_REFLECTOR, lengths
    )
    meant = re.findall(
        r"if it is in m, write ([\d.]+)\.", " ".join(finding.message for finding in check(tmp_path, text))
    )
    assert meant == ["1.46", "0.9", "0.25", "0.52", "0.3"]


TO_REFLECTOR = ("<emitter type=", '<transform name="to_world"> <translate x="{}"/> </transform> <emitter type=')
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


def test_no_board_is_worth_a_note(tmp_path):
    (finding,) = check(tmp_path, PAD.split('<shape type="rectangle">')[0] + "</scene>")
    assert (finding.severity, finding.line) == ("note", 4) and "there is no board" in finding.message


SURFACE = "<scale value="
NO_ROOF = ('<bsdf name="roof" type="wall">', '<bsdf name="{}" type="wall">')
LIGHT = {
    "roof absorbs": (PAD, NO_ROOF, "side", "roof", "warning", 4, "roof of deformable_pad absorbs, and only its sides"),
    "nothing comes back": (PAD, ('"0.9"', '"{}"'), "0", "0.01", "warning", 4, "absorbs, and so do its sides"),
    "region of a package": (PAD, NO_ROOF, "led", "roof", "warning", 9, "led is no region of deformable_pad"),
    "no LED": (PLATE, ('<emitter type="annular_led"/>', "{}"), "", '<emitter type="annular_led"/>', "error", 0,
               "holds 0 LEDs and 1 phototransistors"),
    "another emitter": (PLATE, ('"annular_led"', '"{}"'), "area", "annular_led", "error", 6,
                        "every emitter must be an annular_led"),
    "no power": (PAD, IN_LED, parameter("power", 0), parameter("power", 1e-3), "warning", 15, "power = 0"),
    "detector first": (PAD, ('"taxel_tracer"/>', "{}"), '"taxel_path"/>', '"analog_tracer"/>', "", 0, ""),
    "no wall": (PLATE, ('<bsdf type="wall">\n    <string name="scattering" value="mirror"/>\n  </bsdf>', "{}"), "",
                '<bsdf type="wall"/>', "warning", 16, "rectangle has no bsdf"),
    "a region on a rectangle": (PLATE, ('<bsdf type="wall">\n    <string name="scattering" value="mirror"/>', "{}"),
                                '<bsdf type="region"> <bsdf name="roof" type="wall"/>', '<bsdf type="wall">',
                                "warning", 18, "rectangle has no regions"),
    "a sampler of Mitsuba": (PLATE, ("owen_sobol", "{}"), "independent", "owen_sobol", "error", 13,
                             "its sampler must be owen_sobol, not independent"),
}  # fmt: skip


@pytest.mark.parametrize("text, place, wrong, right, severity, line, message", LIGHT.values(), ids=LIGHT.keys())
def test_light(tmp_path, text, place, wrong, right, severity, line, message):
    found = check(tmp_path, change(text, place, wrong))
    if severity:
        assert any(
            (finding.severity, finding.line) == (severity, line) and re.search(message, finding.message)
            for finding in found
        ), found
    else:
        assert found == []
    assert check(tmp_path, change(text, place, right)) == []


@pytest.mark.parametrize(
    "integrator, scattering, law, severity",
    [
        ("taxel_tracer", "isotropic", "lambertian", None),
        ("analog_tracer", "isotropic", "lambertian", None),
        ("taxel_path", "isotropic", "lambertian", "error"),
        ("taxel_path", "lambertian", "lambertian", None),
        ("taxel_path", "lambertian", "uniform_polar_angle", "error"),
        ("path", "isotropic", "lambertian", "warning"),
        ("path", "lambertian", "lambertian", None),
        ("ptracer", "isotropic", "lambertian", None),
    ],
)
def test_paths_from_the_phototransistor(tmp_path, integrator, scattering, law, severity):
    text = change(PAD, ("taxel_tracer", "{}"), integrator)
    text = text.replace('<float name="reflectance" value="0.9"/>', parameter("scattering", scattering, "string"))
    found = check(tmp_path, change(text, IN_LED, parameter("law", law, "string")))
    assert [finding.severity for finding in found] == ([] if severity is None else [severity])
    said = "taxel_path: " if severity == "error" else "starts at the phototransistor"
    assert all(said in finding.message and finding.line == 3 for finding in found)


def test_a_table_must_reach_the_wavelength(tmp_path):
    (tmp_path / "paint.csv").write_text("400, 0.5\n1000, 0.9\n")
    text = PAD.replace('<float name="reflectance" value="0.9"/>', parameter("reflectance_table", "paint.csv", "string"))
    assert check(tmp_path, text) == []
    (finding,) = check(tmp_path, change(text, IN_LED, parameter("wavelength", 1550)))
    assert (finding.severity, finding.line) == ("error", 9) and "1550" in finding.message
    other = PACKAGE.format(0.0).replace('"annular_led"/>', f'"annular_led">{parameter("wavelength", 850)}</emitter>')
    both = change(change(text, ('name="rows" value="3"', 'name="rows" value="{}"'), 1), AT_END, other)
    both = both.replace('name="columns" value="3"', 'name="columns" value="1"').replace(
        '<translate x="0.0"/>', '<translate x="3.55"/>'
    )
    assert check(tmp_path, both) == []
    (finding,) = check(tmp_path, both.replace("taxel_tracer", "ptracer"))
    assert finding.severity == "error" and "850, 925 nm" in finding.message


def test_mitsubas_own_integrators_need_the_origin(tmp_path):
    away = PLATE.replace("</transform>", '<translate y="100"/> </transform>')
    assert check(tmp_path, away) == []
    (finding,) = check(tmp_path, away.replace("taxel_tracer", "path"))
    assert finding.severity == "error" and "use taxel_tracer" in finding.message


def test_parameters_count(tmp_path):
    assert "pulls" in check(tmp_path, PAD, fz=5)[0].message
    assert check(tmp_path, PAD, fz=-10) == []
    with pytest.raises(InputError, match="fx is not a parameter"):
        check(tmp_path, PAD, fx=1)
    with pytest.raises(InputError, match="does not exist"):
        check_scene(tmp_path / "nowhere.xml")


def test_an_unused_default_is_found(tmp_path):
    (finding,) = check(tmp_path, PAD.replace("$fz", "-5"))
    assert (finding.severity, finding.line) == ("error", 2) and "fz is used nowhere" in finding.message


def test_files_that_are_included(tmp_path):
    """Findings name the file; parameters and defaults go through both."""
    (tmp_path / "board.xml").write_text(
        '<scene version="3.9.0">\n<shape type="rectangle">\n<float name="sise" value="1"/>\n<bsdf type="wall"/>'
        '<transform name="to_world"> <scale value="10"/> <translate z="$down"/> </transform>\n</shape> </scene>'
    )
    text = PAD.split('<shape type="rectangle">')[0] + '<include filename="board.xml"/> </scene>'
    found = check(tmp_path, text.replace("<default", '<default name="down" value="0"/> <default', 1))
    assert [(finding.file, finding.line) for finding in found] == [("board.xml", 3)]
    (tmp_path / "board.xml").write_text(
        '<scene version="3.9.0">\n<shape type="rectangle">\n<transform name="to_world"> <scale value="10"/>'
        '<translate z="$down"/> </transform>\n<bsdf type="wall">\n<float name="reflectance" value="2"/>'
        "</bsdf></shape></scene>"
    )
    found = check(tmp_path, text.replace("<default", '<default name="down" value="0"/> <default', 1))
    assert [(finding.file, finding.line) for finding in found] == [("board.xml", 5)]
    found = check(tmp_path, text.replace("board.xml", "bord.xml"))
    assert [(finding.file, finding.line) for finding in found] == [("scene.xml", 19)]


def test_a_whole_scene_is_included_by_a_relative_path(tmp_path, monkeypatch):
    (tmp_path / "inner.xml").write_text(PAD)
    (tmp_path / "outer.xml").write_text('<scene version="3.9.0"> <include filename="inner.xml"/> </scene>')
    monkeypatch.chdir(tmp_path)
    assert check_scene("outer.xml", fz=-1) == []
    (finding,) = check_scene("outer.xml", fz=1)
    assert finding.file == "inner.xml" and "pulls" in finding.message


def test_a_scene_of_nothing(tmp_path):
    (finding,) = check(tmp_path, '<scene version="3.9.0"/>')
    assert (finding.severity, finding.file, finding.line) == ("error", "scene.xml", 0) and "0 LEDs" in finding.message


@pytest.mark.parametrize(
    "text, line, message",
    [
        ("<scene version='3.9.0'>\n<shape</scene>", 2, "does not parse as XML"),
        ("", 1, "no element found"),
        ("<scene>" + 20 * "<bsdf>" + 20 * "</bsdf>" + "</scene>", 1, "more than 16 elements"),
        ('<scene version="3.9.0">\n<include filename="scene.xml"/></scene>', 2, "includes itself"),
        ('<?xml version="1.0" encoding="foo"?><scene/>', 0, "unknown encoding"),
    ],
)
def test_what_is_no_scene(tmp_path, text, line, message):
    (finding,) = check(tmp_path, text)
    assert (finding.severity, finding.line) == ("error", line) and message in finding.message


def test_a_pad_from_a_file(tmp_path):
    """The surface is read, not meshed."""
    (tmp_path / "pad.stl").write_bytes((shipped_scenes() / "hexagonal.stl").read_bytes())
    text = PAD.replace(parameter("cell", "cylindrical", "string"), parameter("filename", "pad.stl", "string"))
    assert check(tmp_path, text) == []
    (tmp_path / "pad.stl").write_bytes(b"solid nothing")
    (finding,) = check(tmp_path, text)
    assert (finding.severity, finding.line) == (
        "error",
        5,
    ) and "pad.stl is not allowed: it is no STL" in finding.message


def test_nothing_is_deformed_or_traced(tmp_path, monkeypatch):
    import mitsuba as mi

    from mitsuba_taxel import mechanics

    def refuse(*_, **__):
        raise AssertionError("a check computed")

    monkeypatch.setattr(mechanics, "load_path", refuse)
    monkeypatch.setattr(mi, "render", refuse)
    monkeypatch.setattr(mi.parser, "instantiate", refuse)
    assert check(tmp_path, PAD) == []
