"""Light: scenes, their parts as Python objects, and readings with their error."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mitsuba_taxel.optics.objects import PadSensor, PhotoReflector, Wall
    from mitsuba_taxel.optics.readings import Readings, measure, points_for
    from mitsuba_taxel.optics.scene import Scene, find_scene, write_xml

_LAZY = {
    "PadSensor": "objects",
    "PhotoReflector": "objects",
    "Readings": "readings",
    "Scene": "scene",
    "Wall": "objects",
    "find_scene": "scene",
    "measure": "readings",
    "points_for": "readings",
    "write_xml": "scene",
}

__all__ = [
    "PadSensor",
    "PhotoReflector",
    "Readings",
    "Scene",
    "Wall",
    "find_scene",
    "measure",
    "points_for",
    "write_xml",
]


def __getattr__(name: str) -> object:
    # Plugins import modules of this package one by one, before any variant is set.
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
