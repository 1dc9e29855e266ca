"""Messages name the scene's own parameters beside those of the plugins."""

from __future__ import annotations

import re
from types import SimpleNamespace

import pytest

from mitsuba_taxel import InputError, Scene
from mitsuba_taxel.sensing.scene.finding import shipped_scenes
from mitsuba_taxel.sensing.scene.parsed_parts import refusal_of
from mitsuba_taxel.sensing.scene.parsing import with_own_parameters

PLATE = """<scene version="3.0.0"><default name="roof" value="0.5"/><default name="cover" value="0.5"/>
  <default name="from" value="0"/><default name="past" value=""/>
  <bsdf type="wall"><float name="reflectance" value="$roof"/></bsdf>
  <bsdf type="wall"><float name="reflectance" value="$cover"/></bsdf>
  <shape type="deformable_pad"><vector name="force" x="$from" z="-$roof"/><string name="history" value="$past"/></shape>
</scene>"""


@pytest.mark.parametrize(
    ("values", "message", "named"),
    [
        ({"roof": "1.2"}, "reflectance = 1.2 is not allowed.", "roof = 1.2"),
        ({"roof": "1.2", "cover": "1.2"}, "reflectance = 1.2 is not allowed.", "roof = 1.2, cover = 1.2"),
        ({"cover": "nan"}, "reflectance = nan is not allowed.", "cover = nan"),
        ({"roof": "2", "from": "3"}, "x: force = (3.0, 0.0, -2.0) N is not allowed.", "from = 3, roof = 2"),
        ({"past": "0 1; 3"}, "history row '3' is not allowed.", "past = 0 1; 3"),
        ({}, "reflectance = 1.2 is not allowed.", ""),
        ({}, "a reflectance is needed.", ""),
    ],
)
def test_the_parameter_whose_value_is_refused_is_named(tmp_path, values, message, named):
    (tmp_path / "a.xml").write_text(PLATE)
    parameters = {"roof": "0.5", "cover": "0.5", "from": "0", **values}
    scene = SimpleNamespace(source=tmp_path / "a.xml", parameters=parameters)
    own = f" (parameter {named})" if named else ""
    assert with_own_parameters(message, scene) == f"{message[:-1]}{own}."


@pytest.mark.parametrize("file", sorted(shipped_scenes().glob("*.xml")), ids=lambda file: file.name)
def test_each_default_of_a_shipped_scene_is_named_if_refused(llvm_mono, tmp_path, file):
    text, count = file.read_text(), 0
    names = re.findall(r'<default name="(\w+)"', text)
    for name in names:
        text = re.sub(rf'(<default name="|\$){name}\b', rf"\1own_{name}", text)
    (tmp_path / file.name).write_text(text)
    for stl in file.parent.glob("*.stl"):
        (tmp_path / stl.name).write_bytes(stl.read_bytes())
    for name in names:
        for value in ("nan", "nonsense"):
            refusal = refusal_of(Scene(tmp_path / file.name, {f"own_{name}": value}))
            if refusal is not None:
                count += 1
                assert f"own_{name}" in str(refusal)
    assert count > len(names)


def test_a_refused_scene_names_it_when_it_is_loaded(llvm_mono, tmp_path):
    text = '<scene version="3.0.0"><default name="a" value="0"/><default name="file" value="x.exr"/>'
    text += '<bsdf type="wall"><float name="reflectance" value="$a"/></bsdf><emitter type="envmap">'
    (tmp_path / "a.xml").write_text(text + '<string name="filename" value="$file"/></emitter></scene>')
    with pytest.raises(InputError, match=r"^reflectance = 1\.2 .* is needed \(parameter a = 1\.2\)\.$"):
        Scene(tmp_path / "a.xml", {"a": "1.2"}).load()
    with pytest.raises(InputError, match=r"^filename = '/dev/zero' .* \(parameter file = /dev/zero\)\.$"):
        Scene(tmp_path / "a.xml", {"file": "/dev/zero"}).load()
