"""Scenes that are damaged at random are read, or refused in one line, and a check and a measurement never disagree."""

from __future__ import annotations

import pytest
import trimesh
from damaged_scenes import PAD, PLATE, damaged_bytes, damaged_tree
from hypothesis import given, settings
from hypothesis import strategies as st

from mitsuba_taxel import ComputationError, InputError, Scene, check_scene, measure
from mitsuba_taxel.sensing.scene.finding import shipped_scenes

STOCK = PLATE.replace('"taxel_tracer"', '"path"')
OPEN = PLATE.split("<integrator")[0] + PLATE.split("</integrator>")[1]
BACKWARDS = OPEN.replace("<shape", '<integrator type="taxel_path"/> <shape', 1)
SMALL_PAD = PAD.replace('"wall"> <string name="scattering" value="mirror"/>', '"wall">')


def assert_agreement(file, isolated) -> None:
    outcome = isolated.measure(file)
    if outcome is not None:
        kind, message = outcome
        assert kind in ("InputError", "ComputationError") and message and "\n" not in message, outcome
    try:
        errors = [finding for finding in check_scene(file) if finding.severity == "error"]
    except InputError as error:
        errors = [error]
    assert bool(outcome) == bool(errors), (outcome, errors)


@settings(max_examples=160)
@given(data=st.data(), text=st.sampled_from([PLATE, STOCK, OPEN, BACKWARDS]))
def test_damaged_scenes(data, text, isolated, tmp_path):
    file = tmp_path / "scene.xml"
    file.write_bytes(damaged_tree(data, text))
    assert_agreement(file, isolated)


@settings(max_examples=30)
@given(data=st.data())
def test_damaged_pads(data, isolated, tmp_path):
    file = tmp_path / "scene.xml"
    file.write_bytes(damaged_tree(data, SMALL_PAD))
    assert_agreement(file, isolated)


@settings(max_examples=40)
@given(data=st.data())
def test_damaged_bytes(data, isolated, tmp_path):
    file = tmp_path / "scene.xml"
    file.write_bytes(damaged_bytes(data, PLATE.encode()))
    assert_agreement(file, isolated)


FROM_FILE = """<scene version="3.9.0"> <integrator type="taxel_tracer"/>
<shape type="deformable_pad"> <string name="filename" value="FILE"/> EXTRA
  <bsdf type="region"> <bsdf name="roof" type="wall"/> </bsdf> </shape>
<shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape> </scene>"""
CELL = '<integer name="rows" value="1"/> <integer name="columns" value="1"/>'


@pytest.fixture
def pads(tmp_path):
    """A folder of pads that are none."""
    block = trimesh.creation.box(extents=(5, 5, 3))
    block.apply_translation([0, 0, 1.5])
    block.export(tmp_path / "without_cells.stl")
    trimesh.Trimesh(block.vertices, block.faces[1:]).export(tmp_path / "open_without_cells.stl")
    block.apply_translation([0, 0, 1])
    block.export(tmp_path / "in_the_air.stl")
    (tmp_path / "good.stl").write_bytes((shipped_scenes() / "hexagonal.stl").read_bytes())
    pad = trimesh.load_mesh(tmp_path / "good.stl")
    trimesh.Trimesh(pad.vertices, pad.faces[200:]).export(tmp_path / "open.stl")
    (tmp_path / "cut.stl").write_bytes((tmp_path / "good.stl").read_bytes()[:-7])
    (tmp_path / "broken.step").write_text("ISO-10303-21;\nHEADER;\nnonsense")
    (tmp_path / "empty.step").touch()
    (tmp_path / "pad.doc").write_text("a pad")
    (tmp_path / "nobody.toml").write_text('[[rule]]\nregion = "roof"\nface = "nobody"\n')
    (tmp_path / "ceiling.toml").write_text('[[rule]]\nregion = "ceiling"\n')
    return tmp_path


@pytest.mark.parametrize(
    "file, extra",
    [
        *((name, "") for name in ("without_cells.stl", "open_without_cells.stl", "in_the_air.stl", "open.stl")),
        *((name, "") for name in ("cut.stl", "broken.step", "empty.step", "pad.doc", "nothing.stl")),
        ("good.stl", '<string name="regions" value="nobody.toml"/>'),
        ("good.stl", '<string name="regions" value="ceiling.toml"/>'),
        ("good.stl", '<float name="mesh_size" value="1e-4"/>'),
        (None, '<float name="mesh_size" value="1e-3"/>'),
        (None, '<float name="height" value="1e8"/>'),
        (None, '<integer name="subdivision" value="65"/>'),
        (None, '<string name="finish" value="layer_steps"/> <float name="layer_height" value="1e-5"/>'),
        (None, '<string name="finish" value="layer_steps"/> <float name="layer_height" value="3"/>'),
    ],
)
def test_pads_that_cannot_be_meshed(llvm_mono, pads, file, extra):
    """In the same words."""
    scene = pads / "scene.xml"
    text = FROM_FILE.replace("EXTRA", extra).replace("FILE", file or "")
    scene.write_text(text if file else text.replace('<string name="filename" value=""/>', CELL))
    with pytest.raises(InputError) as caught:
        measure(Scene.from_file(scene), points=4)
    assert str(caught.value) in [found.message for found in check_scene(scene) if found.severity == "error"]


def test_a_round_mirror_of_few_triangles(llvm_mono, tmp_path):
    scene = tmp_path / "scene.xml"
    cell = f'{CELL} <string name="cell" value="hemispheric"/> <integer name="subdivision" value="2"/>'
    text = FROM_FILE.replace('<string name="filename" value="FILE"/> EXTRA', cell)
    scene.write_text(text.replace('type="wall"/>', 'type="wall"> <string name="scattering" value="mirror"/> </bsdf>'))
    with pytest.raises(InputError, match="subdivision = 2 is not allowed") as caught:
        measure(Scene.from_file(scene), points=4)
    assert [str(caught.value)] == [found.message for found in check_scene(scene) if found.severity == "error"]


CAVITY = """<scene version="3.9.0"> <integrator type="taxel_tracer"/>
<shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/>
  <bsdf type="region"> <bsdf name="body" type="wall"/> <bsdf name="led" type="wall"/>
    <bsdf name="phototransistor" type="wall"/> </bsdf> </shape>
<shape type="cube"> <transform name="to_world"> <scale value="2"/> <translate z="1"/> </transform>
  <bsdf type="wall"/> </shape> </scene>"""


@pytest.mark.parametrize(
    ("text", "message"),
    [(BACKWARDS.replace('value="0.7"', 'value="0.02"'), "hardly any path"), (CAVITY, "not absorbed anywhere")],
    ids=["narrow gap", "cavity"],
)
def test_what_a_few_rays_find(llvm_mono, tmp_path, text, message):
    file = tmp_path / "scene.xml"
    file.write_text(text)
    with pytest.raises(ComputationError, match=message) as caught:
        measure(Scene.from_file(file), points=4)
    assert [str(caught.value)] == [found.message for found in check_scene(file) if found.severity == "error"]


SOFT_PAD = """<scene version="3.9.0"> <integrator type="taxel_tracer"/>
<shape type="deformable_pad"> <integer name="rows" value="1"/> <integer name="columns" value="1"/>
  <float name="youngs_modulus" value="0.5"/> <float name="mesh_size" value="2.5"/> LOAD
  <bsdf type="region"> <bsdf name="roof" type="wall"/> </bsdf> </shape>
<shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
<shape type="rectangle"> <transform name="to_world"> <scale value="10"/> </transform> <bsdf type="wall"/> </shape>
</scene>"""


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ('<vector name="force" value="0, 0, -8"/>', "unstable"),
        ('<vector name="force" value="9, 0, 0"/>', "touches itself"),
        ('<string name="load" value="pressure"/> <float name="pressure" value="-30"/>', "does not converge"),
    ],
    ids=["unstable", "touches", "suction"],
)
def test_what_only_a_deformed_pad_shows(llvm_mono, tmp_path, load, message):
    """In the same words, and as a computation that stops."""
    file = tmp_path / "scene.xml"
    file.write_text(SOFT_PAD.replace("LOAD", load))
    with pytest.raises(ComputationError, match=message) as caught:
        measure(Scene.from_file(file), points=4, mechanics_error=False)
    errors = [finding for finding in check_scene(file) if finding.severity == "error"]
    assert [(error.message, error.stopped) for error in errors] == [(str(caught.value), True)]


def test_a_value_that_puts_a_part_nowhere_is_named(llvm_mono, tmp_path):
    file = tmp_path / "scene.xml"
    file.write_text(PLATE)
    for value in ("nan", "inf", "-1e9"):
        with pytest.raises(InputError, match=rf"to_world of rectangle .* \(parameter z = {value}\)\.$") as caught:
            Scene.from_file(file, z=value).load()
        assert [str(caught.value)] == [found.message for found in check_scene(file, z=value)]


def test_a_default_given_twice_is_refused(tmp_path):
    file = tmp_path / "scene.xml"
    file.write_text(PLATE.replace("<int", '<default name="z" value="1"/>\n<int', 1))
    with pytest.raises(InputError, match="the <default> z is given twice: take one of them out"):
        Scene.from_file(file)
    (finding,) = check_scene(file)
    assert (finding.severity, finding.line) == ("error", 3) and "z is given twice" in finding.message
