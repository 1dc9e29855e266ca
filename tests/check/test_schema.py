"""The schema of scenes: what it takes, what it does not, and that the file in the package is the one made now."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from lxml import etree

from mitsuba_taxel import InputError, Pad, PadSensor, write_template, write_xml
from mitsuba_taxel.check.schema import schema, write_schema
from mitsuba_taxel.sensing.scene.finding import shipped_scenes
from mitsuba_taxel.specification.plugin_pages import plugin_names, plugin_page

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[2]
HEAD = '<scene version="3.9.0">{}</scene>'


@pytest.fixture(scope="module")
def relaxng():
    return etree.RelaxNG(etree.parse(str(shipped_scenes() / "taxel.rng")))


def test_the_shipped_schema_is_that_of_the_plugins():
    assert (shipped_scenes() / "taxel.rng").read_text() == schema()


def test_written_to_a_file(tmp_path):
    write_schema(tmp_path / "scenes.rng")
    assert (tmp_path / "scenes.rng").read_text() == schema()
    with pytest.raises(InputError, match="a .rng file is needed"):
        write_schema(tmp_path / "scenes.xsd")
    with pytest.raises(InputError, match="cannot be written"):
        write_schema(tmp_path / "nowhere" / "scenes.rng")


@pytest.mark.parametrize("name", sorted(file.name for file in shipped_scenes().glob("*.xml")))
def test_shipped_scenes_are_valid(relaxng, name):
    relaxng.assertValid(etree.parse(str(shipped_scenes() / name)))


@pytest.mark.parametrize("kind", ["scene", "touch"])
def test_the_templates_are_valid(relaxng, tmp_path, kind):
    write_template(kind, tmp_path / "scene.xml")
    relaxng.assertValid(etree.parse(str(tmp_path / "scene.xml")))


def test_scenes_of_the_readme_are_valid(relaxng):
    scenes = re.findall(r"```xml\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    assert scenes
    for scene in scenes:
        relaxng.assertValid(etree.fromstring(scene))


def test_a_scene_that_mitsuba_has_written_is_valid(relaxng, tmp_path):
    write_xml(PadSensor(Pad("hemispheric"), force=(0, 0, -1)).scene(), tmp_path / "scene.xml")
    relaxng.assertValid(etree.parse(str(tmp_path / "scene.xml")))


@pytest.mark.parametrize("name", plugin_names())
def test_examples_of_the_plugins_are_valid(relaxng, name):
    relaxng.assertValid(etree.fromstring(HEAD.format(plugin_page(name).example)))


PAD = '<shape type="deformable_pad">{}</shape>'
REGION = '<bsdf type="region">{}</bsdf>'
LED = '<shape type="rectangle"> <emitter type="annular_led">{}</emitter> </shape>'
VALID = {
    "a number": PAD.format('<float name="youngs_modulus" value=" 4.16e0 "/>'),
    "a whole number for a number": PAD.format('<integer name="pitch" value="4"/>'),
    "a name": PAD.format('<integer name="rows" value="$rows"/> <string name="cell" value="$cell"/>'),
    "a vector": PAD.format('<vector name="force" value="0 0, -1"/>'),
    "a vector by components": PAD.format('<vector name="force" x="0" y="0" z="-$fz"/>'),
    "a vector of names": PAD.format('<vector name="force" value="$fx, $fy, -5"/>'),
    "a transformation": PAD.format('<transform name="to_world"><rotate x="1" angle="180"/></transform>'),
    "an id": '<shape type="deformable_pad" id="pad"/>',
    "a wall with a name": PAD.format('<bsdf name="anything" type="wall"/>'),
    "a wall of Mitsuba": PAD.format('<bsdf type="diffuse"> <rgb name="reflectance" value="0.5"/> </bsdf>'),
    "a region of walls of Mitsuba": REGION.format('<bsdf name="roof" type="dielectric" id="glass"/>'),
    "a reference": REGION.format('<ref name="roof" id="white"/>'),
    "a type by name": '<integrator type="$integrator"> <integer name="max_depth" value="8"/> </integrator>',
    "declarations": '<default name="a" value="1"/> <include filename="b.xml"/> <path value="c"/>'
    '<alias id="d" as="e"/>',
    "Mitsuba's own": '<shape type="ply"> <string name="filename" value="a.ply"/> <boolean name="x" value="true"/>'
    "</shape>",
    "a film": '<shape type="rectangle"> <sensor type="phototransistor"> <film type="hdrfilm"> <rfilter type="box"/>'
    "</film> <sampler type='owen_sobol'/> </sensor> </shape>",
}  # fmt: skip
INVALID = {
    "misspelt parameter": PAD.format('<float name="young_modulus" value="4"/>'),
    "parameter of another plugin": LED.format('<float name="pitch" value="4"/>'),
    "wrong element": PAD.format('<float name="rows" value="3"/>'),
    "word for a number": LED.format('<string name="power" value="1"/>'),
    "no number": LED.format('<float name="power" value="one"/>'),
    "number with a unit": LED.format('<float name="wavelength" value="925 nm"/>'),
    "a fraction of a whole number": PAD.format('<integer name="rows" value="2.5"/>'),
    "two components": PAD.format('<vector name="force" value="0, -5"/>'),
    "word out of the list": PAD.format('<string name="cell" value="round"/>'),
    "no value": LED.format('<float name="power"/>'),
    "no region": REGION.format('<bsdf name="ceiling" type="wall"/>'),
    "a wall that says not where": REGION.format('<bsdf type="wall"/>'),
    "an LED in a pad": PAD.format('<emitter type="annular_led"/>'),
    "a misspelt element": '<shap type="rectangle"/>',
    "a misspelt parameter deep inside": PAD.format(
        REGION.format('<bsdf name="roof" type="wall"> <float name="reflectence" value="1"/> </bsdf>')
    ),
    "a plugin of another kind": '<bsdf type="annular_led"/>',
}


@pytest.mark.parametrize("content", VALID.values(), ids=VALID.keys())
def test_valid(relaxng, content):
    relaxng.assertValid(etree.fromstring(HEAD.format(content)))


@pytest.mark.parametrize("content", INVALID.values(), ids=INVALID.keys())
def test_invalid(relaxng, content):
    assert not relaxng.validate(etree.fromstring(HEAD.format(content)))
