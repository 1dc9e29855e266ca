"""The deformed pad: finite strain, nearly incompressible finite elements, and the path to a load."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.balance import Reactions, reactions
    from mitsuba_taxel.mechanics.contact import Contact, ContactTest
    from mitsuba_taxel.mechanics.fields import NodalFields, nodal_fields
    from mitsuba_taxel.mechanics.finish import Finish, Grooves, LayerSteps, RandomRoughness, check_finish
    from mitsuba_taxel.mechanics.loads import Load, PatchForce, PlateDisplacement, PlateForce, Pressure, SpreadForce
    from mitsuba_taxel.mechanics.locate import displacement_at, displacement_gradient_at
    from mitsuba_taxel.mechanics.materials import Material, MooneyRivlin, NeoHookean, Yeoh
    from mitsuba_taxel.mechanics.path import State, load_path, mesh_size_for
    from mitsuba_taxel.mechanics.roof_error import RoofError
    from mitsuba_taxel.mechanics.sensitivities import LinearisedState, linearise
    from mitsuba_taxel.mechanics.silicones import SILICONES, Silicone, from_shore_a, silicone
    from mitsuba_taxel.mechanics.solvers import available_solvers
    from mitsuba_taxel.mechanics.surface import Surface, tessellate
    from mitsuba_taxel.mechanics.vtu import write_vtu

_LAZY = {
    "Contact": "contact",
    "ContactTest": "contact",
    "Finish": "finish",
    "Grooves": "finish",
    "LayerSteps": "finish",
    "LinearisedState": "sensitivities",
    "Load": "loads",
    "Material": "materials",
    "MooneyRivlin": "materials",
    "NeoHookean": "materials",
    "NodalFields": "fields",
    "PatchForce": "loads",
    "PlateDisplacement": "loads",
    "PlateForce": "loads",
    "Pressure": "loads",
    "RandomRoughness": "finish",
    "Reactions": "balance",
    "RoofError": "roof_error",
    "SILICONES": "silicones",
    "Silicone": "silicones",
    "SpreadForce": "loads",
    "State": "path",
    "Surface": "surface",
    "Yeoh": "materials",
    "available_solvers": "solvers",
    "check_finish": "finish",
    "displacement_at": "locate",
    "displacement_gradient_at": "locate",
    "from_shore_a": "silicones",
    "linearise": "sensitivities",
    "load_path": "path",
    "mesh_size_for": "path",
    "nodal_fields": "fields",
    "reactions": "balance",
    "silicone": "silicones",
    "tessellate": "surface",
    "write_vtu": "vtu",
}

__all__ = [
    "Contact",
    "ContactTest",
    "Finish",
    "Grooves",
    "LayerSteps",
    "LinearisedState",
    "Load",
    "Material",
    "MooneyRivlin",
    "NeoHookean",
    "NodalFields",
    "PatchForce",
    "PlateDisplacement",
    "PlateForce",
    "Pressure",
    "RandomRoughness",
    "Reactions",
    "RoofError",
    "SILICONES",
    "Silicone",
    "SpreadForce",
    "State",
    "Surface",
    "Yeoh",
    "available_solvers",
    "check_finish",
    "displacement_at",
    "displacement_gradient_at",
    "from_shore_a",
    "linearise",
    "load_path",
    "mesh_size_for",
    "nodal_fields",
    "reactions",
    "silicone",
    "tessellate",
    "write_vtu",
]


def __getattr__(name: str) -> object:
    # A scene without a pad imports none of this.
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
