"""Light: scenes, their parts as Python objects, and readings with their error."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mitsuba_taxel.optics.audit import EnergyAudit, energy_audit
    from mitsuba_taxel.optics.objects import AnnularLed, PhotoReflector, Phototransistor, Wall
    from mitsuba_taxel.optics.pad_sensor import PadSensor
    from mitsuba_taxel.optics.ray_paths import RayPaths, sample_paths
    from mitsuba_taxel.optics.readings import crosstalk, measure
    from mitsuba_taxel.optics.results import Crosstalk, Readings
    from mitsuba_taxel.optics.scene import Scene, find_scene, write_xml

_LAZY = {
    "AnnularLed": "objects",
    "Crosstalk": "results",
    "EnergyAudit": "audit",
    "PadSensor": "pad_sensor",
    "PhotoReflector": "objects",
    "Phototransistor": "objects",
    "RayPaths": "ray_paths",
    "Readings": "results",
    "Scene": "scene",
    "Wall": "objects",
    "crosstalk": "readings",
    "energy_audit": "audit",
    "find_scene": "scene",
    "measure": "readings",
    "sample_paths": "ray_paths",
    "write_xml": "scene",
}

__all__ = [
    "AnnularLed",
    "Crosstalk",
    "EnergyAudit",
    "PadSensor",
    "PhotoReflector",
    "Phototransistor",
    "RayPaths",
    "Readings",
    "Scene",
    "Wall",
    "crosstalk",
    "energy_audit",
    "find_scene",
    "measure",
    "sample_paths",
    "write_xml",
]


def __getattr__(name: str) -> object:
    # Plugins import modules of this package one by one, before any variant is set.
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
