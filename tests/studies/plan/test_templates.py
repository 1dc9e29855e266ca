"""The files to start from can be used as they are, and say of each parameter what is true."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import fields

import numpy as np
import pytest

from mitsuba_taxel import InputError, Scene, measure
from mitsuba_taxel.electronics.circuit import read_circuit
from mitsuba_taxel.parts import Part, Side, read_part
from mitsuba_taxel.sensing import find_scene
from mitsuba_taxel.specification import specifications
from mitsuba_taxel.specification.photo_reflector import PhotoReflector
from mitsuba_taxel.specification.plugin_pages import plugin_page
from mitsuba_taxel.studies import read_steps
from mitsuba_taxel.studies.plan.templates import SUFFIXES, write_template

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib


@pytest.fixture(scope="module")
def template(tmp_path_factory):
    """The path of a template of some kind, by kind."""
    folder = tmp_path_factory.mktemp("templates")
    files = {kind: folder / f"{kind}{suffix}" for kind, suffix in SUFFIXES.items()}
    for kind, file in files.items():
        write_template(kind, file)
    return files


def test_the_scene_reads_as_the_shipped_pad(llvm_mono, template):
    given = measure(Scene.from_file(template["scene"]), points=16, seed=3, mechanics_error=False)
    shipped = measure(Scene.from_file("pad.xml", fz=-5), points=16, seed=3, mechanics_error=False)
    assert len(given.power) == 9 and np.all(given.power > 0) and np.all(given.standard_error > 0)
    np.testing.assert_allclose(given.power, shipped.power, rtol=1e-6)
    np.testing.assert_allclose(given.photocurrent, shipped.photocurrent, rtol=1e-6)


SMALL = {"rows": 1, "columns": 1, "fz": 0}


@pytest.mark.parametrize(
    ("name", "factor"),
    [("led_power", 3.0), ("quantum_efficiency", 0.25), ("wavelength", 0.5), ("roof_reflectance", 0.5)],
)
def test_a_default_does_what_its_name_says(llvm_mono, template, name, factor):
    def read(**given):
        return measure(Scene.from_file(template["scene"], **SMALL, **given), points=16)

    plain = read()
    changed = read(**{name: factor * float(plain.parameters[name])})
    # With absorbing sides light meets the roof once; a photon's energy goes with 1 / wavelength.
    power = {"led_power": 3.0, "roof_reflectance": 0.5}.get(name, 1.0)
    np.testing.assert_allclose(changed.power, power * plain.power, rtol=1e-4)
    np.testing.assert_allclose(changed.photocurrent, factor * plain.photocurrent, rtol=1e-4)


@pytest.mark.parametrize(("name", "value"), [("dy", 0.3), ("tilt", 4.0)])
def test_assembly_offsets_to_both_sides_are_alike(llvm_mono, template, name, value):
    """A cell and its package are their own mirror images, but for random numbers; false alarms of 5 sigma: 6e-7."""

    def read(**given):
        return measure(Scene.from_file(template["scene"], **SMALL, **given), points=512, mechanics_error=False)

    plain, one, other = (read(**{name: offset}) for offset in (0, value, -value))
    assert abs(one.power[0] - other.power[0]) < 5 * np.hypot(one.standard_error[0], other.standard_error[0])
    assert plain.power[0] - one.power[0] > 5 * np.hypot(plain.standard_error[0], one.standard_error[0])


def test_a_turned_board_is_the_cell_turned_back(llvm_mono, template):
    """The same random numbers see the same paths, as a square cell has the symmetry of 90 degrees."""

    def read(**given):
        return measure(Scene.from_file(template["scene"], **SMALL, **given), points=64, mechanics_error=False)

    for side, turn in ((0.3, 90), (-0.3, -90)):
        turned, moved = read(dy=0.3, turn=turn), read(dx=side)
        np.testing.assert_allclose(turned.replicates, moved.replicates, rtol=1e-3)  # single paths meet edges
        np.testing.assert_allclose(turned.power, moved.power, rtol=1e-5)


def test_a_gap_takes_the_roof_away(llvm_mono, template):
    """As a pad that is so much higher, and so are its cells, but for light through the gap, which the board absorbs."""

    def read(**given):
        return measure(Scene.from_file(template["scene"], **SMALL, **given), points=512, mechanics_error=False)

    plain, apart = read(), read(gap=0.1)
    assert plain.power[0] - apart.power[0] > 5 * np.hypot(plain.standard_error[0], apart.standard_error[0])


@pytest.mark.parametrize(
    ("kind", "named"),
    [
        ("scene", ["cell", "roof", "side", "law", "board"]),
        ("touch", ["indenter", "cell", "roof", "side", "law", "board"]),
    ],
)
def test_every_word_that_the_scene_allows_is_allowed(llvm_mono, template, kind, named):
    small = SMALL if kind == "scene" else {"rows": 1, "columns": 1, "indenter_depth": 0}
    text = template[kind].read_text(encoding="utf-8")
    choices = re.findall(r'<default name="(\w+)" value="[a-z]\w+"/> *<!-- ([\w, ]+) -->', text)
    assert [name for name, _ in choices] == named
    for name, words in choices:
        allowed = words.split(", ")
        assert len(allowed) >= 3
        for word in allowed:
            Scene.from_file(template[kind], **small, **{name: word}).load()
        with pytest.raises(InputError, match="smooth"):
            Scene.from_file(template[kind], **small, **{name: "smooth"}).load()


@pytest.mark.parametrize("kind", ["scene", "touch"])
def test_the_scene_uses_each_of_its_defaults(template, kind):
    root = ElementTree.parse(template[kind]).getroot()
    declared = [element.get("name") for element in root.iter("default")]
    used = {name for e in root.iter() for value in e.attrib.values() for name in re.findall(r"\$(\w+)", value)}
    assert len(set(declared)) == len(declared) > 20 and set(declared) == used


@pytest.mark.parametrize("kind", ["scene", "touch", "pad.xml"])
def test_numbers_are_the_defaults_of_the_plugins(template, kind):
    """Such as the modulus: what a parameter is without being given is stated once."""
    root = ElementTree.parse(template.get(kind) or find_scene(kind)).getroot()
    given = {element.get("name"): element.get("value") for element in root.iter("default")}
    compared = {}
    for element in root.iter():
        if element.get("type") in specifications():
            defaults = {row.name: row.default_text for row in plugin_page(element.get("type")).parameters}
            for child in element:
                name = child.get("value", "")[1:]
                if child.get("value", "").startswith("$") and child.tag in ("float", "integer", "string"):
                    compared[child.get("name")] = given[name], defaults[child.get("name")]
    for name in ("rows", "columns"):
        compared.pop(name, None)  # as many photo-reflectors as the pad has cells
    numbers = {name: pair for name, pair in compared.items() if re.match(r"-?[0-9.]+(,|$)", pair[1])}
    assert {"youngs_modulus", "poisson_ratio"} <= set(numbers)
    for name, (value, default) in numbers.items():
        assert float(value) == float(default.split(",")[0]), name


def test_the_study_names_scenes_and_parameters_that_exist(template):
    study = tomllib.loads(template["study"].read_text(encoding="utf-8"))
    assert set(study) == {"target_error", "seed", "scenes"} and study["target_error"] == 0.005
    assert [scene["name"] for scene in study["scenes"]] == ["normal", "tangential"]
    for scene in study["scenes"]:
        tables = [scene.get(name, {}) for name in ("define", "vary", "together")]
        names = [name for table in tables for name in table]
        assert len(set(names)) == len(names)
        Scene(find_scene(scene["scene"]), scene["define"] | dict.fromkeys(names, "0"))
    normal, tangential = study["scenes"]
    assert normal["vary"] == {"fz": "0:-20:-0.5"}
    assert tangential["together"] == {"fx": "0:4:0.25", "fy": "0:4:0.25"} and tangential["define"]["fz"] == -8


def test_the_steps_are_a_path_of_forces(template):
    steps = read_steps(template["steps"])
    forces = np.array([[float(step[name]) for name in ("fx", "fy", "fz")] for step in steps])
    assert steps[0].keys() == {"fx", "fy", "fz"} and len(forces) == 8
    assert np.all(np.abs(np.diff(forces, axis=0)).sum(axis=1) <= 2) and tuple(forces[-1]) == (4, 0, -8)


def test_the_part_states_what_may_be_stated_and_can_be_used(template):
    stated = tomllib.loads(template["part"].read_text(encoding="utf-8"))
    assert {field.name for field in fields(Part)} - set(stated) == {"name", "distance_curve", "stated"}
    assert {field.name for field in fields(Side)} - set(stated["emitter"]) == {"exponent"}
    assert PhotoReflector(part=str(template["part"])).package.body == tuple(stated["body"])


@pytest.mark.parametrize(("kind", "read"), [("part", read_part), ("circuit", read_circuit)])
def test_lines_that_are_commented_out_can_be_commented_in(template, tmp_path, kind, read):
    text = template[kind].read_text(encoding="utf-8")
    optional = [line for line in text.splitlines() if re.match(r"# *\w+ = ", line)]
    assert optional
    for line in optional:
        name = line.removeprefix("# ").split()[0]
        (tmp_path / "own.toml").write_text(text.replace(line, line.removeprefix("# ")), encoding="utf-8")
        assert getattr(read(tmp_path / "own.toml"), name)


@pytest.mark.parametrize(
    ("kind", "name", "culprit"),
    [
        ("scene", "taken.xml", "exists"),
        ("study", "taken.toml", "exists"),
        ("steps", "taken.csv", "exists"),
        ("scene", "new.toml", r"\.xml"),
        ("study", "new", r"\.toml"),
        ("steps", "nowhere/new.csv", "cannot be written"),
        ("pad", "new.xml", "'pad'"),
    ],
)
def test_refuses(tmp_path, kind, name, culprit):
    for suffix in SUFFIXES.values():
        (tmp_path / f"taken{suffix}").write_text("mine")
    with pytest.raises(InputError, match=culprit):
        write_template(kind, tmp_path / name)
    assert {file.read_text() for file in tmp_path.iterdir()} == {"mine"}
