"""Units of a scene's parameters, from the units of the plugins' parameters that take their values."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from mitsuba_taxel.parameters import Number, Parameter
from mitsuba_taxel.sensing.scene.scene_file import read_scene_file
from mitsuba_taxel.specification import specifications

_NAME = re.compile(r"(?:^|[\s,])-?\$(\w+)(?=$|[\s,])")
"""A parameter used as a number, or as a component of a vector."""


def units_of_parameters(scene: Path) -> dict[str, str]:
    """Find the units of the ``<default>`` elements of an XML scene.

    The unit is that of the plugins' parameters, translations and rotations that use the ``<default>``. A ``<default>``
    without a known unit, or with uses of different units, is left out.

    Parameters
    ----------
    scene : Path
        XML file of the scene.

    Returns
    -------
    dict[str, str]
        Units by name, in alphabetical order; ``1`` for a dimensionless parameter.
    """
    units: dict[str, set[str]] = {}
    for unit, text in _uses(scene):
        for name in _NAME.findall(text):
            units.setdefault(name, set()).add(unit)
    return {name: of_uses.pop() for name, of_uses in sorted(units.items()) if len(of_uses) == 1}


def _uses(scene: Path) -> Iterator[tuple[str, str]]:
    """Iterate over the attributes of a scene that have a unit: the unit and the text of the attribute."""
    for element in (element for _, root in read_scene_file(scene) for element in root.iter()):
        specification = specifications().get(element.get("type", ""))
        parameters = {} if specification is None else specification.values()
        for child in element:
            unit = _unit(parameters.get(child.get("name", "")))
            for text in child.attrib.values() if unit else ():
                yield unit, text
        if element.tag == "translate":
            for text in element.attrib.values():
                yield "mm", text
        if element.tag == "rotate":
            yield "degrees", element.get("angle", "")


def _unit(parameter: Parameter | None) -> str:
    if parameter is None:
        return ""
    return parameter.unit or ("1" if isinstance(parameter, Number) else "")
