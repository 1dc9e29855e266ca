"""Objects nested in shapes that Mitsuba takes without a word and does not use."""

from __future__ import annotations

import mitsuba as mi

_FOLLOWED = ("BSDF", "Emitter", "Sensor", "Medium", "Texture")
"""Objects that the base class of shapes follows; it ignores all others."""
_LEAVES = ("rectangle", "disk", "cube", "sphere", "cylinder", "obj", "ply", "serialized")
"""Mitsuba's shapes that hold no other objects than those."""
_SIDES = ("interior", "exterior")


def unused_in_shape(nodes: list[mi.parser.SceneNode], node: mi.parser.SceneNode) -> dict[str, str]:
    """Error messages for objects nested in a parsed shape that would have no effect, by their name in it.

    Our own plugins refuse what they do not know themselves, see `Specification.unknown`, except for media.
    """
    props, refused = node.props, {}
    if node.type != mi.ObjectType.Shape:
        return {}
    for name in props.keys():  # noqa: SIM118
        if props.type(name) != mi.Properties.Type.ResolvedReference:
            continue
        child, plugin = nodes[props[name].index()], props.plugin_name()
        if child.type == mi.ObjectType.Medium and name not in _SIDES:
            refused[name] = f"the medium in a {plugin} has no effect unless its name is {' or '.join(_SIDES)}."
        elif plugin in _LEAVES and child.type.name not in _FOLLOWED:
            refused[name] = f"{plugin} has no use for the {child.props.plugin_name()} nested in it: take it out."
    return refused
