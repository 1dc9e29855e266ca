"""Roles of the parameters of a scene, such as component of a load, time or position of an indenter. The role follows
from the places where the parameter is used."""

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
    """Find the role of each parameter of an XML scene: the parameter of a plugin that takes its value.

    Parameters
    ----------
    scene : Path
        XML file of the scene.

    Returns
    -------
    dict[str, tuple[str, int]]
        Role and sign, by name of the scene's parameter. The sign is -1 for a parameter that is used as ``-$name``, else
        1. The role is the name of a plugin's parameter, such as ``pressure`` or ``indenter_x``; for a component of a
        vector, the name is followed by ``_x``, ``_y`` or ``_z``, as in ``translate_x``; for the load of a
        `deformable_pad`, the role is ``fx``, ``fy``, ``fz``, ``ux``, ``uy`` or ``uz``. A parameter that is used in
        different ways is left out. So are parameters that share one role.
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
    """Find the parameters of an XML scene that are used only as a component of the force on its `deformable_pad`s.

    Parameters
    ----------
    scene : Path
        XML file of the scene.

    Returns
    -------
    dict[str, tuple[str, int]]
        Component of the force (one of `FORCES`) and sign, by name of the parameter. The sign is -1 for a parameter that
        is used as ``-$name``, else 1. A parameter with the name of a component also counts as that component if it is
        not used in a force, and only in the unit N.
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
    """Find the components of the load of a scene's pad that are constant numbers: in ``0.1, 0, $fz``, ``fx`` is ``0.1``
    and ``fy`` is ``0``.

    Parameters
    ----------
    scene : Path
        XML file of the scene.

    Returns
    -------
    dict[str, str]
        Values as text, by role.
    """
    loads = (*_COMPONENTS.values(), "pressure")
    return {role: word.strip() for role, word in _uses(scene) if role in loads and "$" not in word and word.strip()}


def _uses(scene: Path) -> Iterator[tuple[str, str]]:
    """Iterate over all attributes of a scene's elements: the role (parameter of a plugin) and the text of the value.
    The role is empty for attributes without one."""
    for root in (root for _, root in read_scene_file(scene)):
        for parent in root.iter():
            for element in parent:
                if element.tag != "default":
                    yield from _words(element, parent.get("type") == _PAD)


def _words(element: ElementTree.Element, of_pad: bool) -> Iterator[tuple[str, str]]:
    """Iterate over the roles (parameters of plugins) that one XML element defines, each with the text of its value."""
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
