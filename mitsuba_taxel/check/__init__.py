"""Scenes looked over before they are rendered: names, units, places and light."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mitsuba_taxel.check.finding import Finding
    from mitsuba_taxel.check.scene import check_scene

_LAZY = {"Finding": "finding", "check_scene": "scene"}

__all__ = ["Finding", "check_scene"]


def __getattr__(name: str) -> object:
    # The schema asks for the plugins' tables alone, which needs no variant.
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
