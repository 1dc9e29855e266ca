"""The deformed pad: finite strain, nearly incompressible finite elements, and the path to a load."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.finish import Finish, Grooves, LayerSteps, RandomRoughness, check_finish
    from mitsuba_taxel.mechanics.materials import NeoHookean
    from mitsuba_taxel.mechanics.path import State, load_path
    from mitsuba_taxel.mechanics.solvers import available_solvers
    from mitsuba_taxel.mechanics.surface import Surface, tessellate

_LAZY = {
    "Finish": "finish",
    "Grooves": "finish",
    "LayerSteps": "finish",
    "NeoHookean": "materials",
    "RandomRoughness": "finish",
    "State": "path",
    "Surface": "surface",
    "available_solvers": "solvers",
    "check_finish": "finish",
    "load_path": "path",
    "tessellate": "surface",
}

__all__ = [
    "Finish",
    "Grooves",
    "LayerSteps",
    "NeoHookean",
    "RandomRoughness",
    "State",
    "Surface",
    "available_solvers",
    "check_finish",
    "load_path",
    "tessellate",
]


def __getattr__(name: str) -> object:
    # A scene without a pad imports none of this.
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
