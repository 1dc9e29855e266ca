"""Which parameters of a scene are components of the force on its pad, found where they are used."""

from __future__ import annotations

import re
from pathlib import Path

from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.sensing.left_out import used_by
from mitsuba_taxel.sensing.parameter_units import units_of_parameters
from mitsuba_taxel.sensing.scene_file import read_scene_file

_ALONE = re.compile(r"\s*(?P<sign>[+-]?)\s*\$(?P<name>\w+)\s*")


def forces_of_parameters(scene: Path) -> dict[str, tuple[str, int]]:
    """The parameters of an XML scene that are a component of the force of its `deformable_pad`s, and nothing else.

    Returns
    -------
    By name, the component, one of `FORCES`, and 1, or -1 of a parameter that is used as ``-$name``. A parameter that is
    called as a component, used nowhere in a force and in no unit but N, counts as that component, as in scenes of other
    plugins.
    """
    roles: dict[str, set[tuple[str, int] | None]] = {}
    for root in (root for _, root in read_scene_file(scene)):
        of_pads = {
            child
            for pad in root.iter()
            if pad.get("type") == "deformable_pad"
            for child in pad
            if child.get("name") == "force"
        }
        for element in root.iter():
            if element not in of_pads:
                for name in used_by(element.attrib):
                    roles.setdefault(name, set()).add(None)
                continue
            words = element.get("value")
            parts = words.split(",") if words else [element.get(axis, "") for axis in "xyz"]
            if words and len(parts) != len(FORCES):
                parts = words.split()
            for component, part in zip(FORCES, parts, strict=False):
                match = _ALONE.fullmatch(part)
                for name in used_by({"value": part}):
                    sign = -1 if match and match["sign"] == "-" else 1
                    roles.setdefault(name, set()).add((component, sign) if match else None)
    in_force = {name: role for name, found in roles.items() if len(found) == 1 and (role := next(iter(found)))}
    components = [component for component, _ in in_force.values()]
    unique = {name: role for name, role in in_force.items() if components.count(role[0]) == 1}
    units = units_of_parameters(scene)
    called = {
        name: (name, 1)
        for name in FORCES
        if units.get(name, "N") == "N" and (name not in roles or roles[name] == {None})
    }
    return {**{name: role for name, role in called.items() if name not in components}, **unique}
