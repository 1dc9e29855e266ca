"""Cached meshes of pads."""

from __future__ import annotations

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.path import cache
from mitsuba_taxel.pads.pad import Pad
from mitsuba_taxel.pads.pad_file import PadFile


def pad_mesh(pad: Pad | PadFile, mesh_size: float) -> VolumeMesh:
    """The undeformed mesh of a pad, with elements of a size in mm, from disk or from the mesher."""
    name = cache.key("mesh", [pad.identity, mesh_size])
    with cache.alone(name):
        arrays = cache.load(name)
        if arrays is None:
            mesh = pad.mesh(mesh_size)
            cache.store(name, vars(mesh))
            return mesh
    return VolumeMesh(**arrays)
