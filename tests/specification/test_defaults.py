"""Scenes that ship with the package, and that users start from, have the defaults of the plugins."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import pytest

from mitsuba_taxel import write_template
from mitsuba_taxel.parameters import Number, Whole
from mitsuba_taxel.sensing.scene import shipped_scenes
from mitsuba_taxel.specification import specifications


@pytest.fixture(params=["hexagonal.xml", "pad.xml", "template"])
def scene(request, tmp_path):
    if request.param != "template":
        return shipped_scenes() / request.param
    write_template("scene", tmp_path / "scene.xml")
    return tmp_path / "scene.xml"


def test_numbers_are_those_of_the_plugins(scene):
    root = ElementTree.parse(scene).getroot()
    allowed: dict[str, set[float]] = {}
    for element in root.iter():
        stated = specifications().get(element.get("type", ""))
        for child in element if stated is not None else ():
            parameter = stated.values().get(child.get("name"))
            stands_alone = isinstance(parameter, Number | Whole) and child.get("value", "").startswith("$")
            if stands_alone and parameter.default is not None:  # Poisson's ratio is that of the silicone
                allowed.setdefault(child.get("value")[1:], set()).add(parameter.default)
    assert "youngs_modulus" in allowed
    given = {element.get("name"): element.get("value") for element in root.iter("default")}
    for name, defaults in allowed.items():
        assert float(given[name]) in defaults, name
