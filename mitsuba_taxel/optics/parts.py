"""Objects that a plugin makes for itself."""

from __future__ import annotations

from typing import Any

import mitsuba as mi


def make_plugin(name: str, **parameters: Any) -> Any:
    """An object of the plugin ``name``; nested objects are given as such.

    Not ``mi.load_dict``: that exchanges Mitsuba's one file resolver for a while, which a plugin must not do while
    other plugins of the scene are made on other threads (a ``ply`` then reads freed memory).
    """
    props = mi.Properties(name)
    for key, value in parameters.items():
        props[key] = value
    return mi.PluginManager.instance().create_object(props)
