"""Checks of whole scene files: sound ones, their parameters, what they include, and what is no scene."""

from __future__ import annotations

import pytest
from flawed_scene import PAD, PLATE, check

from mitsuba_taxel import InputError, Pad, PadSensor, check_scene, write_template, write_xml
from mitsuba_taxel.sensing.scene.finding import shipped_scenes

pytestmark = pytest.mark.usefixtures("static")


@pytest.mark.parametrize("text", [PAD, PLATE], ids=["pad", "plate"])
def test_a_sound_scene_has_no_findings(tmp_path, text):
    assert check(tmp_path, text) == []


@pytest.mark.parametrize("cell", ["parallelepiped", "spherical", "hemispheric", "profile"])
def test_a_sensor_made_in_python_has_none(tmp_path, llvm_mono, cell):
    pad = Pad("spherical", 2, 1).as_profile() if cell == "profile" else Pad(cell, rows=2, columns=1)
    sensor = PadSensor(pad=pad, force=(0.1, 0, -2))
    write_xml(sensor.scene(), tmp_path / "scene.xml")
    assert check_scene(tmp_path / "scene.xml") == []


@pytest.mark.parametrize("name", sorted(file.name for file in shipped_scenes().glob("*.xml")))
def test_shipped_scenes_have_none(name):
    assert check_scene(name) == []


@pytest.mark.parametrize("kind", ["scene", "touch"])
def test_the_templates_have_none(tmp_path, kind):
    write_template(kind, tmp_path / "scene.xml")
    assert check_scene(tmp_path / "scene.xml") == []


def test_parameters_count(tmp_path):
    assert "pulls" in check(tmp_path, PAD, fz=5)[0].message
    assert check(tmp_path, PAD, fz=-10) == []
    with pytest.raises(InputError, match="fx is not a parameter"):
        check(tmp_path, PAD, fx=1)
    with pytest.raises(InputError, match="does not exist"):
        check_scene(tmp_path / "nowhere.xml")


def test_an_unused_default_is_found(tmp_path):
    (finding,) = check(tmp_path, PAD.replace("$fz", "-5"))
    assert (finding.severity, finding.line) == ("warning", 2) and "fz is used nowhere" in finding.message


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
        ("<scene version='3.9.0'>\n<shape</scene>", 2, "the file is not valid XML"),
        ("", 1, "no element found"),
        ("<scene>" + 20 * "<bsdf>" + 20 * "</bsdf>" + "</scene>", 1, "nested more than 16 deep"),
        ('<scene version="3.9.0">\n<include filename="scene.xml"/></scene>', 2, "includes itself"),
        ('<?xml version="1.0" encoding="foo"?><scene/>', 0, "unknown encoding"),
    ],
)
def test_what_is_no_scene(tmp_path, text, line, message):
    (finding,) = check(tmp_path, text)
    assert (finding.severity, finding.line) == ("error", line) and message in finding.message


def test_nothing_is_deformed_or_traced(tmp_path, monkeypatch):
    import mitsuba as mi

    from mitsuba_taxel import mechanics

    def refuse(*_, **__):
        raise AssertionError("a check computed")

    monkeypatch.setattr(mechanics, "load_path", refuse)
    monkeypatch.setattr(mi, "render", refuse)
    monkeypatch.setattr(mi.parser, "instantiate", refuse)
    assert check(tmp_path, PAD) == []
