"""Mitsuba's objects: made by our plugins for themselves, and called by their plugin's name."""

from __future__ import annotations

import re
from pathlib import Path
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


def found(name: str) -> Path:
    """A file named in a scene, looked for beside the scene."""
    return Path(str(mi.file_resolver().resolve(name)))


def kind_of(made: Any) -> str:
    """The plugin's name, as its class has it: Mitsuba's own classes are not seen from Python, ours only from there."""
    ours = type(made).__module__ != "mitsuba"
    name = type(made).__name__ if ours else made.class_name()
    name = name.removesuffix("Integrator").removesuffix("Mesh") or "Mesh"
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
