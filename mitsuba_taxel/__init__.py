"""Simulation of optoelectronic tactile sensors: force, deformed pad, light, reading.

Importing this package chooses an LLVM that works, imports mitsuba and makes its plugins known to
``mi.load_file``, ``mi.load_string`` and ``mi.load_dict`` in every variant. Nothing else heavy is imported.

Units everywhere: mm, N, MPa, W, s; angles in degrees.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from mitsuba_taxel.backend import check_llvm, choose_llvm, register_for_every_variant
from mitsuba_taxel.errors import ComputationError, InputError

choose_llvm()
check_llvm()
register_for_every_variant()

if TYPE_CHECKING:
    from mitsuba_taxel.check import check_scene
    from mitsuba_taxel.mechanics import (
        Grooves,
        LayerSteps,
        MooneyRivlin,
        NeoHookean,
        PatchForce,
        PlateDisplacement,
        PlateForce,
        Pressure,
        RandomRoughness,
        SpreadForce,
        Yeoh,
        from_shore_a,
        linearise,
        load_path,
        silicone,
        tessellate,
    )
    from mitsuba_taxel.optics import (
        AnnularLed,
        PadSensor,
        PhotoReflector,
        Phototransistor,
        Readings,
        Scene,
        Wall,
        crosstalk,
        energy_audit,
        measure,
        write_xml,
    )
    from mitsuba_taxel.pads import Pad, PadFile
    from mitsuba_taxel.report.notebook import show
    from mitsuba_taxel.studies import open_study, run_study, sweep, training_set, write_template

_LAZY = {
    "AnnularLed": "mitsuba_taxel.optics",
    "Grooves": "mitsuba_taxel.mechanics",
    "LayerSteps": "mitsuba_taxel.mechanics",
    "MooneyRivlin": "mitsuba_taxel.mechanics",
    "NeoHookean": "mitsuba_taxel.mechanics",
    "Pad": "mitsuba_taxel.pads",
    "PadFile": "mitsuba_taxel.pads",
    "PadSensor": "mitsuba_taxel.optics",
    "PatchForce": "mitsuba_taxel.mechanics",
    "PhotoReflector": "mitsuba_taxel.optics",
    "Phototransistor": "mitsuba_taxel.optics",
    "PlateDisplacement": "mitsuba_taxel.mechanics",
    "PlateForce": "mitsuba_taxel.mechanics",
    "Pressure": "mitsuba_taxel.mechanics",
    "RandomRoughness": "mitsuba_taxel.mechanics",
    "Readings": "mitsuba_taxel.optics",
    "Scene": "mitsuba_taxel.optics",
    "SpreadForce": "mitsuba_taxel.mechanics",
    "Wall": "mitsuba_taxel.optics",
    "Yeoh": "mitsuba_taxel.mechanics",
    "check_scene": "mitsuba_taxel.check",
    "crosstalk": "mitsuba_taxel.optics",
    "energy_audit": "mitsuba_taxel.optics",
    "from_shore_a": "mitsuba_taxel.mechanics",
    "linearise": "mitsuba_taxel.mechanics",
    "load_path": "mitsuba_taxel.mechanics",
    "measure": "mitsuba_taxel.optics",
    "open_study": "mitsuba_taxel.studies",
    "run_study": "mitsuba_taxel.studies",
    "show": "mitsuba_taxel.report.notebook",
    "silicone": "mitsuba_taxel.mechanics",
    "sweep": "mitsuba_taxel.studies",
    "tessellate": "mitsuba_taxel.mechanics",
    "training_set": "mitsuba_taxel.studies",
    "write_template": "mitsuba_taxel.studies",
    "write_xml": "mitsuba_taxel.optics",
}

__all__ = [
    "AnnularLed",
    "ComputationError",
    "Grooves",
    "InputError",
    "LayerSteps",
    "MooneyRivlin",
    "NeoHookean",
    "Pad",
    "PadFile",
    "PadSensor",
    "PatchForce",
    "PhotoReflector",
    "Phototransistor",
    "PlateDisplacement",
    "PlateForce",
    "Pressure",
    "RandomRoughness",
    "Readings",
    "Scene",
    "SpreadForce",
    "Wall",
    "Yeoh",
    "check_scene",
    "crosstalk",
    "energy_audit",
    "from_shore_a",
    "linearise",
    "load_path",
    "measure",
    "open_study",
    "run_study",
    "show",
    "silicone",
    "sweep",
    "tessellate",
    "training_set",
    "write_template",
    "write_xml",
]


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        return version("mitsuba_taxel")
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
