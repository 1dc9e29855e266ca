"""Roles of the parameters of a scene, from where they are used: components of loads, times, positions of indenters."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from mitsuba_taxel.base.units import DISPLACEMENTS, FORCES
from mitsuba_taxel.sensing.scene.left_out import used_by
from mitsuba_taxel.sensing.scene.parameter_units import units_of_parameters
from mitsuba_taxel.sensing.scene.scene_file import read_scene_file

_ALONE = re.compile(r"\s*(?P<sign>[+-]?)\s*\$(?P<name>\w+)\s*")
_PAD = "deformable_pad"
_COMPONENTS = {
    f"{quantity}_{axis}": name
    for quantity, names in (("force", FORCES), ("displacement", DISPLACEMENTS))
    for axis, name in zip("xyz", names, strict=True)
}


def roles_of_parameters(scene: Path) -> dict[str, tuple[str, int]]:
    """The role of each parameter of an XML scene: the parameter of a plugin that uses it.

    Parameters
    ----------
    scene : Path
        XML file of the scene.

    Returns
    -------
    dict[str, tuple[str, int]]
        Role and sign by name of the parameter; the sign is -1 for a parameter that is used as ``-$name``, else 1. A
        role is the name of a plugin's parameter, such as ``pressure`` or ``indenter_x``; of a vector, with ``_x``,
        ``_y`` or ``_z``, as ``translate_x``; and one of ``fx``, ``fy``, ``fz``, ``ux``, ``uy``, ``uz`` of the load of a
        `deformable_pad`. Parameters with several uses that differ, and roles that several parameters have, are left
        out.
    """
    uses_of: dict[str, set[tuple[str, int] | None]] = {}
    for role, word in _uses(scene):
        match = _ALONE.fullmatch(word)
        for name in used_by({"value": word}):
            sign = -1 if match and match["sign"] == "-" else 1
            uses_of.setdefault(name, set()).add((role, sign) if match and role else None)
    roles = {name: use for name, uses in uses_of.items() if len(uses) == 1 and (use := next(iter(uses)))}
    count = Counter(role for role, _ in roles.values())
    return {name: use for name, use in roles.items() if count[use[0]] == 1}


def forces_of_parameters(scene: Path) -> dict[str, tuple[str, int]]:
    """The parameters of an XML scene that are a component of the force of its `deformable_pad`s, and nothing else.

    Parameters
    ----------
    scene : Path
        XML file of the scene.

    Returns
    -------
    dict[str, tuple[str, int]]
        Component of the force (one of `FORCES`) and sign by name of the parameter; the sign is -1 for a parameter that
        is used as ``-$name``, else 1. In scenes of other plugins, a parameter with the name of a component counts as
        that component, if nothing uses it in a force or in a unit other than N.
    """
    in_force = {name: role for name, role in roles_of_parameters(scene).items() if role[0] in FORCES}
    uses: dict[str, set[str]] = {}
    for role, word in _uses(scene):
        for name in used_by({"value": word}):
            uses.setdefault(name, set()).add(role)
    components, units = {component for component, _ in in_force.values()}, units_of_parameters(scene)
    by_name = {
        name: (name, 1)
        for name in FORCES
        if name not in components and units.get(name, "N") == "N" and not uses.get(name, set()) & {*FORCES, "force"}
    }
    return {**by_name, **in_force}


def load_constants(scene: Path) -> dict[str, str]:
    """The components of the load of a scene's pad that are numbers, by role: ``0.1`` of ``0.1, 0, $fz`` for ``fx``.

    Parameters
    ----------
    scene : Path
        XML file of the scene.

    Returns
    -------
    dict[str, str]
        Values by role.
    """
    loads = (*_COMPONENTS.values(), "pressure")
    return {role: word.strip() for role, word in _uses(scene) if role in loads and "$" not in word and word.strip()}


def _uses(scene: Path) -> Iterator[tuple[str, str]]:
    """Each role in a scene, with the word for its value; the role is blank for other attributes."""
    for root in (root for _, root in read_scene_file(scene)):
        for parent in root.iter():
            for element in parent:
                if element.tag != "default":
                    yield from _words(element, parent.get("type") == _PAD)


def _words(element: ElementTree.Element, of_pad: bool) -> Iterator[tuple[str, str]]:
    """The roles that an element gives, with their words."""
    attributes = dict(element.attrib)
    value = attributes.pop("value", "")
    quantity = attributes.pop("name", "") if element.tag != "translate" else "translate"
    if quantity and (element.tag in ("vector", "point", "translate") or any(axis in attributes for axis in "xyz")):
        words = value.split(",") if "," in value else value.split()
        words = words if len(words) == 3 else [attributes.pop(axis, "") for axis in "xyz"]
        for axis, word in zip("xyz", words, strict=True):
            role = f"{quantity}_{axis}"
            yield _COMPONENTS.get(role, role) if of_pad else "" if role in _COMPONENTS else role, word
        if value and not any(words):  # a vector in one parameter
            yield quantity, value
    elif value:
        yield quantity, value
    for word in attributes.values():
        yield "", word
