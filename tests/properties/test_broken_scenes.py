"""Scenes that are damaged at random: they are read, or refused in one line, and never end the process."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mitsuba_taxel import Scene, measure

EXTREMES = [
    "nan", "inf", "-inf", "1e308", "-1e308", "1e38", "1e-38", "1e-308", "1e400", "0", "-0.0", "-1", "1", "2147483648",
    "4294967296", "99999999999999999999", "100000000", "", " ", "abc", "true", "0, 0, nan", "1e308, 1e308, 1e308",
    "0, 0, -1e30", "$nothing", "$z", "\u00e9\u4e2d", "../..", "/", "a" * 5000, "1 2 3 4", "0.5 nm", "1e-3", "1000",
]  # fmt: skip

PLATE = """<scene version="3.9.0">
<default name="z" value="0.7"/>
<integrator type="taxel_tracer"> <integer name="max_depth" value="8"/> </integrator>
<shape type="photo_reflector">
  <integer name="rows" value="1"/> <integer name="columns" value="2"/> <float name="pitch" value="3.55"/>
  <float name="spacing" value="0.9"/> <vector name="body" value="1.46, 1.06, 0.5"/>
  <emitter type="annular_led"> <float name="power" value="1"/> <float name="size" value="0.25"/>
    <float name="hole" value="0.1"/> <float name="wavelength" value="925"/>
    <string name="law" value="lambertian"/> </emitter>
  <sensor type="phototransistor"> <float name="width" value="0.52"/> <float name="depth" value="0.3"/>
    <string name="response" value="cosine_power"/> <float name="exponent" value="2"/>
    <film type="hdrfilm"> <integer name="width" value="2"/> <integer name="height" value="2"/>
      <rfilter type="box"/> <string name="pixel_format" value="luminance"/> </film>
    <sampler type="owen_sobol"> <integer name="sample_count" value="16"/> </sampler> </sensor>
  <bsdf type="wall"> <float name="reflectance" value="0.3"/> </bsdf>
</shape>
<shape type="rectangle"> <transform name="to_world"> <rotate x="1" angle="180"/> <scale x="4" y="4"/>
    <translate x="0" y="0" z="0.5"/> <translate z="$z"/> </transform>
  <bsdf type="wall"> <string name="scattering" value="lambertian"/> <float name="reflectance" value="0.8"/> </bsdf>
</shape>
</scene>"""

PAD = """<scene version="3.9.0">
<default name="z" value="-0.5"/>
<integrator type="taxel_tracer"/>
<shape type="deformable_pad">
  <string name="cell" value="cylindrical"/> <integer name="rows" value="1"/> <integer name="columns" value="1"/>
  <float name="pitch" value="3.55"/> <float name="wall" value="1"/> <float name="height" value="3"/>
  <float name="cell_size" value="2.55"/> <float name="cell_height" value="1.3"/>
  <string name="material" value="neo_hookean"/> <float name="youngs_modulus" value="4"/>
  <float name="poisson_ratio" value="0.49"/> <string name="load" value="spread_force"/>
  <vector name="force" value="0, 0, $z"/> <float name="mesh_size" value="3"/> <integer name="subdivision" value="2"/>
  <string name="read_cells" value="1"/> <transform name="to_world"> <translate z="0"/> </transform>
  <bsdf type="region"> <bsdf name="roof" type="wall"> <string name="scattering" value="mirror"/> </bsdf>
    <bsdf name="side" type="wall"> <float name="reflectance" value="0.5"/> </bsdf> </bsdf>
</shape>
<shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
</scene>"""


def damaged_tree(data: st.DataObject, text: str) -> bytes:
    """A scene of which elements are taken out, put elsewhere, named otherwise, or given other values."""
    root = ElementTree.fromstring(text)
    for _ in range(data.draw(st.integers(1, 3))):
        parents = {child: parent for parent in root.iter() for child in parent}
        element = data.draw(st.sampled_from(list(parents)))
        what = data.draw(st.sampled_from(["value"] * 6 + ["remove", "double", "move", "tag", "attribute", "drop"]))
        if what == "remove":
            parents[element].remove(element)
        elif what == "double":
            parents[element].append(element)
        elif what == "move":
            target = data.draw(st.sampled_from(list(root.iter())))
            if element not in target.iter() and target not in element.iter():
                parents[element].remove(element)
                target.append(element)
        elif what == "tag":
            element.tag = data.draw(st.sampled_from(sorted({other.tag for other in root.iter()} | {"include", "ref"})))
        elif element.attrib:
            valued = [name for name in element.attrib if name not in ("name", "type")]
            name = data.draw(st.sampled_from((valued if what == "value" and valued else None) or list(element.attrib)))
            if what == "drop":
                del element.attrib[name]
            elif what == "attribute":
                element.set(data.draw(st.sampled_from(["name", "type", "value", "id", "x"])), element.attrib.pop(name))
            else:
                element.set(name, data.draw(st.sampled_from(EXTREMES)))
    return ElementTree.tostring(root, encoding="utf-8")


def damaged_bytes(data: st.DataObject, content: bytes) -> bytes:
    """Bytes of which some are changed, or the end is missing."""
    mutable = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        mutable[data.draw(st.integers(0, len(mutable) - 1))] = data.draw(st.integers(0, 255))
    return bytes(mutable[: data.draw(st.one_of(st.just(len(mutable)), st.integers(0, len(mutable))))])


def assert_one_line(outcome) -> None:
    if outcome is not None:
        kind, message = outcome
        assert kind in ("InputError", "ComputationError") and message and "\n" not in message, outcome


def few(examples: int):
    return settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=[HealthCheck.function_scoped_fixture],
    )


@few(200)
@given(data=st.data())
def test_a_damaged_scene_is_read_or_refused(data, apart, tmp_path):
    file = tmp_path / "scene.xml"
    file.write_bytes(damaged_tree(data, PLATE))
    assert_one_line(apart.measure(file))


@few(40)
@given(data=st.data())
def test_a_scene_of_damaged_bytes_is_read_or_refused(data, apart, tmp_path):
    file = tmp_path / "scene.xml"
    file.write_bytes(damaged_bytes(data, PLATE.encode()))
    assert_one_line(apart.measure(file))


@few(30)
@given(data=st.data())
def test_a_damaged_pad_is_read_or_refused(data, apart, tmp_path):
    file = tmp_path / "scene.xml"
    file.write_bytes(damaged_tree(data, PAD))
    assert_one_line(apart.measure(file))


def with_film(width: int, height: int) -> str:
    text = PLATE.replace('name="width" value="2"', f'name="width" value="{width}"')
    return text.replace('name="height" value="2"', f'name="height" value="{height}"')


def with_array(text: str, rows: int, columns: int) -> str:
    text = re.sub('name="rows" value="1"', f'name="rows" value="{rows}"', text)
    text = re.sub('name="columns" value="[12]"', f'name="columns" value="{columns}"', text)
    return text.replace('<string name="read_cells" value="1"/>', "")


def nested(depth: int) -> str:
    return PLATE.replace("<bsdf", depth * '<bsdf type="twosided">' + "<bsdf").replace(
        "</bsdf>", (depth + 1) * "</bsdf>"
    )


@pytest.mark.parametrize(
    "text, message",
    {
        "film 1e8 wide": (with_film(10**8, 2), "film: 100000000 x 2 pixels .* are not allowed"),
        "film 1e8 high": (with_film(2, 10**8), "film: 2 x 100000000 pixels"),
        "film and array": (with_array(with_film(1000, 10), 1000, 2), "film: 1000 x 10 pixels for each of 2000"),
        "film of nothing": (with_film(0, 1), "film: 0 x 1 pixels"),
        "1e6 packages": (with_array(PLATE, 1000, 1000), "rows = 1000, columns = 1000 are not allowed"),
        "1e4 cells": (with_array(PAD, 100, 100), "rows = 100, columns = 100 are not allowed"),
        "1e8 triangles": (
            with_array(PAD, 40, 40).replace('"subdivision" value="2"', '"subdivision" value="64"'),
            "subdivision = 64 is not allowed: .* triangles",
        ),
        "a place that is infinite": (
            PLATE.replace('value="0.7"', 'value="inf"'),
            "to_world of rectangle is not allowed",
        ),
        "a place that is none": (PLATE.replace('value="0.7"', 'value="nan"'), "to_world of rectangle is not allowed"),
        "a plate of 1e12 mm": (PLATE.replace('x="4" y="4"', 'x="1e12" y="1"'), "to_world of rectangle is not allowed"),
        "a pad nowhere": (PAD.replace('<translate z="0"/>', '<translate z="nan"/>'), "to_world of deformable_pad"),
        "a package of 1e-12 mm": (
            PLATE.replace("1.46, 1.06, 0.5", "1e-12, 1e-12, 1e-12"),
            "body = 1e-12, 1e-12, 1e-12 is not allowed",
        ),
        "1e308 W": (PLATE.replace('"power" value="1"', '"power" value="1e308"'), "power = .* is not allowed"),
        "deep": (nested(100), "scene.xml is not allowed: more than 16 of its elements"),
        "deeper": (nested(100_000), "scene.xml is not allowed: more than 16 of its elements"),
        "in itself": (PLATE.replace("<int", '<include filename="scene.xml"/><int', 1), "it includes itself"),
        "includes none": (
            PLATE.replace("<int", '<include filename="none.xml"/><int', 1),
            r"none\.xml, which scene\.xml includes, cannot be read: No such file or directory\.$",
        ),
        "unknown encoding": ('<?xml version="1.0" encoding="foo"?>' + PLATE, "unknown encoding: foo"),
        "a long name": (PLATE.replace("<int", f'<include filename="{5000 * "a"}"/><int', 1), "File name too long"),
        "entities": (
            '<!DOCTYPE x [<!ENTITY a "' + 100_000 * "h" + '">]>' + PLATE.replace("lambertian", 3000 * "&a;"),
            "does not parse as XML: limit on input amplification",
        ),
        "nothing": ("", "does not parse as XML: no element found"),
    }.values(),
)
def test_what_would_take_all_memory_or_make_no_sense_is_refused(apart, tmp_path, text, message):
    file = tmp_path / "scene.xml"
    file.write_text(text)
    kind, said = apart.measure(file)
    assert kind == "InputError" and re.search(message, said) and "\n" not in said


def test_an_integrator_in_a_shape_is_none_of_the_scene(llvm_mono, tmp_path):
    """One is chosen, as for a scene without any."""
    integrator, rest = '<integrator type="taxel_tracer"/>', PLATE.split("</integrator>")[1]
    file = tmp_path / "scene.xml"
    file.write_text(PLATE.split("<integrator")[0] + rest.replace("<emitter", integrator + "<emitter"))
    assert any(note.startswith("integrator taxel_tracer") for note in measure(Scene.from_file(file), points=4).notes)
