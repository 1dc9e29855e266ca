"""Objects that Mitsuba silently ignores because of where they are nested."""

from __future__ import annotations

import mitsuba as mi

_FOLLOWED = ("BSDF", "Emitter", "Sensor", "Medium", "Texture", "Unknown")
"""Types of nested objects that Mitsuba's base class of shapes uses; all others are ignored. Plugins that a user
registered for one variant only have the type "Unknown"."""
_LEAVES = ("rectangle", "disk", "cube", "sphere", "cylinder", "obj", "ply", "serialized")
"""Mitsuba's shapes that use no other nested objects."""
_SIDES = ("interior", "exterior")
_ON_SURFACES = {"annular_led": "rectangle or a photo_reflector", "area": "shape", "directionalarea": "shape"}
"""Emitters that shine only from a surface, and the objects in which they must be nested."""


def unused_parts(nodes: list[mi.parser.SceneNode], node: mi.parser.SceneNode) -> dict[str, str]:
    """Find objects nested in a parsed scene or shape that would have no effect, with an error message for each.

    The plugins of this package refuse unknown objects themselves, except media; see `Specification.unknown`.

    Parameters
    ----------
    nodes : list[mi.parser.SceneNode]
        Nodes of the parsed scene.
    node : mi.parser.SceneNode
        Node of the scene or of a shape.

    Returns
    -------
    dict[str, str]
        Messages by the name of the nested object; empty if all have an effect.
    """
    props = node.props
    names = [name for name in props.keys() if props.type(name) == mi.Properties.Type.ResolvedReference]  # noqa: SIM118
    messages = {name: _unused(node, name, nodes[props[name].index()]) for name in names}
    return {name: message for name, message in messages.items() if message}


def _unused(node: mi.parser.SceneNode, name: str, child: mi.parser.SceneNode) -> str:
    """The error message for the object ``child`` that is nested in ``node`` under this name; empty if the object may
    have an effect."""
    plugin, nested = node.props.plugin_name(), child.props.plugin_name()
    if node.type == mi.ObjectType.Scene and nested in _ON_SURFACES:
        return f"{nested}: it must be nested in a {_ON_SURFACES[nested]}."
    if node.type != mi.ObjectType.Shape:
        return ""
    if child.type == mi.ObjectType.Medium and name not in _SIDES:
        return f"the medium in a {plugin} has no effect unless its name is {' or '.join(_SIDES)}."
    if plugin in _LEAVES and child.type.name not in _FOLLOWED:
        return f"{plugin} has no use for the {nested} nested in it: take it out."
    return ""
