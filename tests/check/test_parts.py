"""Each parameter or part that a plugin or Mitsuba refuses is found, at its place."""

from __future__ import annotations

import re

import numpy as np
import pytest
import trimesh
from flawed_scene import AT_END, IN_LED, IN_PAD, PAD, PLATE, change, check, parameter

from mitsuba_taxel import check_scene
from mitsuba_taxel.sensing.scene.finding import shipped_scenes

pytestmark = pytest.mark.usefixtures("static")

PAD_ALONE = '<shape type="deformable_pad"/>'


NAMES = {
    "misspelt parameter": (PAD, ("youngs_modulus", "young_modulus{}"), "", 6, "did you mean youngs_modulus"),
    "parameter of another plugin": (PAD, IN_LED, parameter("pitch", 4), 15, "pitch is no parameter of annular_led"),
    "misspelt plugin": (PAD, ("annular_led", "anular_led{}"), "", 14, "'anular_led' is not a plugin .*annular_led"),
    "misspelt plugin of Mitsuba": (PLATE, ("hdrfilm", "hdfilm{}"), "", 11, "'hdfilm' is not a plugin .*hdrfilm"),
    "plugin of another kind": (PAD, ("annular_led", "wall{}"), "", 14, "wall is a plugin for <bsdf>, not"),
    "Mitsuba's plugin of another kind": (PLATE, ("hdrfilm", "box{}"), "", 11, "box is a plugin for <rfilter>"),
    "misspelt element": (PAD, ('<vector name="force"', '<vectr{} name="force"'), "", 7, "<vectr> is not .*vector"),
    "element of another type": (PAD, ("integer", "float{}"), "", 13, "rows of photo_reflector is given by a <float>"),
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
        "deformable_pad is nested in a rectangle",
    ),
    "two integrators": (PAD, AT_END, '<integrator type="taxel_path"/>', 23, "must have one integrator"),
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


def test_a_wall_given_twice_is_odd(tmp_path):
    (finding,) = check(tmp_path, change(PAD, ("  </bsdf>", "{}  </bsdf>"), '<bsdf name="roof" type="wall"/>'))
    assert (finding.severity, finding.line) == ("warning", 10) and "roof is given twice" in finding.message
