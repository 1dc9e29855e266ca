"""The silicone pad: cell shapes, dimensions, pads from files, and volume meshes with tagged regions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mitsuba_taxel.pads.pad import CELL_SHAPES, REGIONS, Pad
from mitsuba_taxel.pads.pad_file import PadFile
from mitsuba_taxel.pads.rules import Rule

if TYPE_CHECKING:
    from mitsuba_taxel.pads.file_meshing import mesh_pad_file
    from mitsuba_taxel.pads.meshing import mesh_pad

__all__ = ["CELL_SHAPES", "REGIONS", "Pad", "PadFile", "Rule", "mesh_pad", "mesh_pad_file"]


def __getattr__(name: str) -> object:
    # A scene that only names a pad's regions needs no mesh.
    if name == "mesh_pad":
        from mitsuba_taxel.pads.meshing import mesh_pad

        return mesh_pad
    if name == "mesh_pad_file":
        from mitsuba_taxel.pads.file_meshing import mesh_pad_file

        return mesh_pad_file
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
