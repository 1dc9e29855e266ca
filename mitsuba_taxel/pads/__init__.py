"""The silicone pad: cell shapes, dimensions, and its volume mesh with tagged regions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mitsuba_taxel.pads.pad import CELL_SHAPES, REGIONS, Pad

if TYPE_CHECKING:
    from mitsuba_taxel.pads.meshing import mesh_pad

__all__ = ["CELL_SHAPES", "REGIONS", "Pad", "mesh_pad"]


def __getattr__(name: str) -> object:
    # A scene that only names a pad's regions needs no mesh.
    if name == "mesh_pad":
        from mitsuba_taxel.pads.meshing import mesh_pad

        return mesh_pad
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
