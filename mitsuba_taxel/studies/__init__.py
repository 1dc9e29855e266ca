"""Batches of scenes over varied parameters, and the store of their results."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mitsuba_taxel.studies.dataset import stage_totals
    from mitsuba_taxel.studies.deformation import deform
    from mitsuba_taxel.studies.steps import read_steps
    from mitsuba_taxel.studies.study import sweep

_LAZY = {"deform": "deformation", "read_steps": "steps", "stage_totals": "dataset", "sweep": "study"}

__all__ = ["deform", "read_steps", "stage_totals", "sweep"]


def __getattr__(name: str) -> object:
    # xarray is loaded by those who sweep, and by nobody else.
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
