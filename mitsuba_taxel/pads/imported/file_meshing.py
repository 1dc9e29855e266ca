"""Second-order tetrahedral mesh of a pad from a file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mitsuba_taxel.base.activities import activity
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.element_maps import worst_element
from mitsuba_taxel.geometry.geometry_error import GeometryError, place
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.imported.local_sizes import default_mesh_size
from mitsuba_taxel.pads.imported.step import mesh_step, surveyed
from mitsuba_taxel.pads.imported.surface_meshing import mesh_surface, parts_of
from mitsuba_taxel.pads.parametric.meshing import LEAST_QUALITY

if TYPE_CHECKING:
    from mitsuba_taxel.pads.pad_file import PadFile


def mesh_pad_file(pad: PadFile, mesh_size: float) -> VolumeMesh:
    """Mesh a pad from a file with elements of about ``mesh_size`` mm.

    Raises
    ------
    InputError
        if ``mesh_size`` is not a finite length above 0, or asks for more elements than fit in memory, or the file holds
        no pad that can be meshed; an error of the surface is reported with its place.
    ComputationError
        if meshing fails, or leaves an inverted element that cannot be repaired.
    """
    if not (math.isfinite(mesh_size) and mesh_size > 0):
        raise InputError(f"mesh_size = {mesh_size:g} is not allowed: a finite number above 0 is needed.")
    with _named(pad), activity(f"meshing {pad.path.name}, elements of {mesh_size:.3g} mm"):
        content = pad.content()
        if pad.is_drawn:
            mesh = mesh_step(pad.path.resolve(), pad.digest, pad.regions, mesh_size, pad.placement)
        else:
            mesh = mesh_surface(content, pad.suffix, pad.regions, mesh_size, pad.placement)
    quality, where = worst_element(mesh)
    if quality < LEAST_QUALITY:
        raise ComputationError(
            f"the mesh has a distorted element near {place(where)}: choose another mesh_size than {mesh_size:g}."
        )
    return mesh


def default_size_of(pad: PadFile) -> float:
    """Default size of elements in mm; raises as :func:`mesh_pad_file` does."""
    with _named(pad), activity(f"reading {pad.path.name}"):
        content = pad.content()
        if pad.is_drawn:
            body = surveyed(pad.path.resolve(), pad.digest, pad.regions, pad.placement)
            surface = (body.patches.vertices, body.patches.triangles, body.patch_region, body.cell[body.face])
        else:
            part, _, _ = parts_of(content, pad.suffix, pad.regions, pad.placement)
            surface = (part.vertices, part.triangles, part.region, part.cell)
        return default_mesh_size(*surface)


@contextmanager
def _named(pad: PadFile) -> Iterator[None]:
    """Turn a `GeometryError` into an `InputError` that names the file."""
    try:
        yield
    except GeometryError as error:
        raise InputError(f"filename = {pad.path} is not allowed: {error}.") from error
