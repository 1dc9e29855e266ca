"""Scenes that ask for too much or make no sense are refused in one line, and never end the process."""

from __future__ import annotations

import re

import pytest
from damaged_scenes import PAD, PLATE

from mitsuba_taxel import InputError, Scene, measure


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
        "deep": (nested(100), "scene.xml is not allowed: its elements are nested more than 16 deep"),
        "deeper": (nested(100_000), "scene.xml is not allowed: its elements are nested more than 16 deep"),
        "in itself": (PLATE.replace("<int", '<include filename="scene.xml"/><int', 1), "it includes itself"),
        "includes none": (
            PLATE.replace("<int", '<include filename="none.xml"/><int', 1),
            r"none\.xml, which scene\.xml includes, cannot be read: No such file or directory\.$",
        ),
        "unknown encoding": ('<?xml version="1.0" encoding="foo"?>' + PLATE, "unknown encoding: foo"),
        "a long name": (PLATE.replace("<int", f'<include filename="{5000 * "a"}"/><int', 1), "File name too long"),
        "entities": (
            '<!DOCTYPE x [<!ENTITY a "' + 100_000 * "h" + '">]>' + PLATE.replace("lambertian", 3000 * "&a;"),
            "is not valid XML: limit on input amplification",
        ),
        "nothing": ("", "is not valid XML: no element found"),
    }.values(),
)
def test_what_would_take_all_memory_or_make_no_sense_is_refused(isolated, tmp_path, text, message):
    file = tmp_path / "scene.xml"
    file.write_text(text)
    kind, said = isolated.measure(file)
    assert kind == "InputError" and re.search(message, said) and "\n" not in said


def test_an_integrator_in_a_shape_is_refused(llvm_mono, tmp_path):
    """Mitsuba would take it and read the scene by another."""
    integrator, rest = '<integrator type="taxel_tracer"/>', PLATE.split("</integrator>")[1]
    file = tmp_path / "scene.xml"
    file.write_text(PLATE.split("<integrator")[0] + rest.replace("<emitter", integrator + "<emitter"))
    with pytest.raises(InputError, match="photo_reflector has no use for the <integrator> nested in it"):
        measure(Scene.from_file(file), points=4)
