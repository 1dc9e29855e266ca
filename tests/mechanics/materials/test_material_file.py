"""Materials from files: what is read, what is refused, and what a scene makes of them."""

from __future__ import annotations

import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.laws import Ogden, Yeoh
from mitsuba_taxel.mechanics.materials.material_file import read_material
from mitsuba_taxel.mechanics.materials.mullins import Mullins
from mitsuba_taxel.sensing.reading.stretch_notes import largest_stretches, stretch_notes
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.parsed_parts import refusal_of
from mitsuba_taxel.specification.deformable_pad import DeformablePad

OGDEN = """
title = "mine"
law = "ogden"
source = "a test"
largest_stretch = 1.4
prony = "0.2 1; 0.1 10"
[constants]
mu_1 = 0.03
alpha_1 = 2.4
[intervals]
mu_1 = [0.02, 0.04]
"""


@pytest.fixture
def write(tmp_path):
    def write(text, name="my.toml"):
        (tmp_path / name).write_text(text)
        return str(tmp_path / name)

    return write


def test_a_file_is_a_law_with_range_memory_and_source(write):
    material = read_material(write(OGDEN))
    assert material.law == Ogden(0.03, 2.4) and material.largest_stretch == 1.4
    assert (material.title, material.source, material.prony) == ("mine", "a test", ((0.2, 1.0), (0.1, 10.0)))
    assert material.content["intervals"] == {"mu_1": [0.02, 0.04]}


def test_a_scene_takes_law_memory_and_range_of_the_file(write):
    pad = DeformablePad(material=write(OGDEN))
    assert pad.build_material() == Ogden(0.03, 2.4) and pad.tested_stretch == 1.4
    assert pad.build_prony() == ((0.2, 1.0), (0.1, 10.0))
    assert DeformablePad(material=pad.material, prony="0.5 2").build_prony() == ((0.5, 2.0),)
    incompressible = DeformablePad(material=pad.material, poisson_ratio=0.5)
    assert incompressible.build_material() == Ogden(0.03, 2.4, poisson_ratio=0.5)
    assert DeformablePad(material="dragon_skin_20").tested_stretch == 1.5
    assert DeformablePad().tested_stretch is None
    with pytest.raises(InputError, match=r"^c10 is not allowed for material = '.*my.toml'"):
        DeformablePad(material=pad.material, c10=0.1)


@pytest.mark.parametrize("material", ["my.toml", "dragon_skin_20"])
def test_a_scene_with_a_material_is_checked_before_it_is_built(llvm_mono, write, tmp_path, material):
    write(OGDEN)
    scene = tmp_path / "scene.xml"
    pad = f'<shape type="deformable_pad"><string name="material" value="{material}"/>%s</shape>'
    scene.write_text(f'<scene version="3.0.0">{pad % ""}</scene>')
    assert refusal_of(Scene(scene)) is None
    refused = pad % '<float name="c10" value="0.1"/>'
    scene.write_text(f'<scene version="3.0.0">{refused}</scene>')
    assert str(refusal_of(Scene(scene))).startswith("c10 is not allowed for material")


def test_mullins_effect_of_the_file_is_that_of_the_scene(write):
    file = write(OGDEN.replace('prony = "0.2 1; 0.1 10"', 'mullins = "2 0.02 0.1"'))
    assert read_material(file).mullins == Mullins(Ogden(0.03, 2.4), 2, 0.02, 0.1)
    pad = DeformablePad(material=file, poisson_ratio=0.48)
    assert pad.build_mullins() == Mullins(Ogden(0.03, 2.4, poisson_ratio=0.48), 2, 0.02, 0.1)
    assert DeformablePad(material=file, mullins="3 0.1").build_mullins() == Mullins(Ogden(0.03, 2.4), 3, 0.1)
    with pytest.raises(InputError, match=r"mullins = '2 0.02 0.1' \(of .*\) is not allowed with viscoelasticity"):
        DeformablePad(material=file, prony="0.1 1", time=1.0)
    with pytest.raises(InputError, match="mullins and prony exclude each other"):
        read_material(write(OGDEN.replace('prony = ', 'mullins = "2 0.02 0.1"\nprony = ')))


def test_poissons_ratio_of_the_file_holds(write):
    file = write('law = "yeoh"\nsource = "x"\n[constants]\nc10 = 0.1\npoisson_ratio = 0.5\n')
    assert DeformablePad(material=file).build_material() == Yeoh(0.1, poisson_ratio=0.5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("law = 3", "law = 3 is not allowed: text is needed"),
        ('law = "yeoh"\nsource = "x"', "constants is missing"),
        ('source = "x"\n[constants]\nc10 = 1', "law is missing"),
        ('law = "yeo"\nsource = "x"\n[constants]\nc10 = 1', "material = 'yeo' is not allowed"),
        ('law = "yeoh"\nsource = "x"\n[constants]\nc01 = 1', "c01 is not known: constants of yeoh are c10, c20, c30"),
        ('law = "yeoh"\nsource = "x"\n[constants]\nc20 = 1', "c10 is missing"),
        ('law = "yeoh"\nsource = "x"\n[constants]\nc10 = -1', "c10 = -1.* is not allowed"),
        ('law = "yeoh"\nsource = "x"\nlargest_stretch = 0.5\n[constants]\nc10 = 1', "largest_stretch = 0.5 is not"),
        ('law = "yeoh"\nsource = "x"\nprony = "2 1"\n[constants]\nc10 = 1', "add up to 2 are not allowed"),
        ('law = "yeoh"\nsource = "x"\nmass = 3\n[constants]\nc10 = 1', "mass is not known"),
        ("law = ", "is not valid TOML"),
    ],
)
def test_what_is_no_material_is_refused_in_one_line(text, words, write):
    with pytest.raises(InputError, match=words) as caught:
        read_material(write(text))
    assert str(caught.value).startswith("material '") and "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_refused():
    with pytest.raises(InputError, match=r"^material 'none.toml' cannot be read: No such file"):
        DeformablePad(material="none.toml")


SCENE = """<scene version="3.9.0">
  <shape type="deformable_pad">
    <integer name="rows" value="1"/> <integer name="columns" value="1"/> <float name="mesh_size" value="2.5"/>
    <string name="material" value="{material}"/> <vector name="force" value="0, 0, -0.15"/>
  </shape>
  <shape type="photo_reflector">
    <integer name="rows" value="1"/> <integer name="columns" value="1"/>
    <emitter type="annular_led"/> <sensor type="phototransistor"/>
  </shape>
</scene>"""


def test_a_reading_says_where_a_pad_is_stretched_beyond_the_tests(write, llvm_mono):
    """The file lies beside the scene, not where the program runs."""
    from mitsuba_taxel.sensing import measure

    notes = {}
    for largest in (1.01, 3.0):
        write(OGDEN.replace("1.4", str(largest)).replace('prony = "0.2 1; 0.1 10"', ""))
        words = measure(write(SCENE.format(material="my.toml"), "scene.xml"), points=16, mechanics_error=False).notes
        notes[largest] = [note for note in words if "stretched" in note]
    assert not notes[3.0]
    (note,) = notes[1.01]
    stretch = float(note.removeprefix("the silicone is stretched to ").split()[0])
    assert 1.01 < stretch < 2 and "its tests reach 1.01: beyond that, its law is an extrapolation" in note


def test_of_many_readings_the_worst_stretch_is_noted():
    tests, law = "its tests reach 1.5", "its law is stable up to 1.9"
    largest = largest_stretches([{}, {tests: 1.6}, {tests: 1.8}, {tests: 1.7, law: 2.0}])
    assert largest == {tests: 1.8, law: 2.0}
    assert stretch_notes(largest) == [
        f"the silicone is stretched to {stretch:.2f} in its most strained 1%, {limit}"
        for stretch, limit in ((1.8, tests), (2.0, law))
    ]
