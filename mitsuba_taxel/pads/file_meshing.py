"""Second-order tetrahedral mesh of a pad that a user brings as a file."""

from __future__ import annotations

import math

from mitsuba_taxel.errors import ComputationError, InputError
from mitsuba_taxel.pads.flaw import Flaw, place
from mitsuba_taxel.pads.meshing import LEAST_QUALITY
from mitsuba_taxel.pads.pad import DEFAULT_MESH_SIZE
from mitsuba_taxel.pads.pad_file import STEP_FORMATS, PadFile
from mitsuba_taxel.pads.quality import worst_element
from mitsuba_taxel.pads.step import mesh_step
from mitsuba_taxel.pads.tetwild import mesh_surface
from mitsuba_taxel.pads.volume_mesh import VolumeMesh


def mesh_pad_file(pad: PadFile, mesh_size: float = DEFAULT_MESH_SIZE) -> VolumeMesh:
    """Mesh a pad from a file with elements of about ``mesh_size`` mm.

    Raises
    ------
    InputError
        if ``mesh_size`` is not a finite length above 0, or asks for more elements than fit in memory, or the file
        holds no pad that can be meshed; a flaw of the surface is named with its place.
    ComputationError
        if meshing fails, or leaves an element inverted that cannot be mended.
    """
    if not (math.isfinite(mesh_size) and mesh_size > 0):
        raise InputError(f"mesh_size = {mesh_size:g} is not allowed: a finite number above 0 is needed.")
    content = pad.content()
    try:
        if pad.suffix in STEP_FORMATS:
            mesh = mesh_step(pad.path, pad.regions, mesh_size)
        else:
            mesh = mesh_surface(content, pad.suffix, pad.regions, mesh_size)
    except Flaw as flaw:
        raise InputError(f"filename = {pad.path} is not allowed: {flaw}.") from flaw
    quality, where = worst_element(mesh)
    if quality < LEAST_QUALITY:
        raise ComputationError(
            f"the mesh has a distorted element near {place(where)}: choose another mesh_size than {mesh_size:g}."
        )
    return mesh
