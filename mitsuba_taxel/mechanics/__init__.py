"""The deformed pad: finite strain, nearly incompressible finite elements, and the path to a load."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.finish import Finish, Grooves, LayerSteps, RandomRoughness, check_finish
    from mitsuba_taxel.mechanics.loads import Load, PatchForce, PlateDisplacement, PlateForce, Pressure, SpreadForce
    from mitsuba_taxel.mechanics.materials import Material, MooneyRivlin, NeoHookean, Yeoh
    from mitsuba_taxel.mechanics.path import State, load_path
    from mitsuba_taxel.mechanics.silicones import SILICONES, Silicone, from_shore_a, silicone
    from mitsuba_taxel.mechanics.solvers import available_solvers
    from mitsuba_taxel.mechanics.surface import Surface, tessellate

_LAZY = {
    "Finish": "finish",
    "Grooves": "finish",
    "LayerSteps": "finish",
    "Load": "loads",
    "Material": "materials",
    "MooneyRivlin": "materials",
    "NeoHookean": "materials",
    "PatchForce": "loads",
    "PlateDisplacement": "loads",
    "PlateForce": "loads",
    "Pressure": "loads",
    "RandomRoughness": "finish",
    "SILICONES": "silicones",
    "Silicone": "silicones",
    "SpreadForce": "loads",
    "State": "path",
    "Surface": "surface",
    "Yeoh": "materials",
    "available_solvers": "solvers",
    "check_finish": "finish",
    "from_shore_a": "silicones",
    "load_path": "path",
    "silicone": "silicones",
    "tessellate": "surface",
}

__all__ = [
    "Finish",
    "Grooves",
    "LayerSteps",
    "Load",
    "Material",
    "MooneyRivlin",
    "NeoHookean",
    "PatchForce",
    "PlateDisplacement",
    "PlateForce",
    "Pressure",
    "RandomRoughness",
    "SILICONES",
    "Silicone",
    "SpreadForce",
    "State",
    "Surface",
    "Yeoh",
    "available_solvers",
    "check_finish",
    "from_shore_a",
    "load_path",
    "silicone",
    "tessellate",
]


def __getattr__(name: str) -> object:
    # A scene without a pad imports none of this.
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
