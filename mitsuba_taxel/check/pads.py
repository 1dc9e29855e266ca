"""Checks of pads before the solve: the cells of a pad from a file, and finishes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.pads import Pad, PadFile

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.surface.finish import Finish
    from mitsuba_taxel.mechanics.surface.wall_finishes import SeparateFinish


def extents_in_file(pad: PadFile, mesh_size: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Bounding boxes of a pad from a file, and of each of its cells.

    A surface is read, repaired and divided into regions; only a STEP file has to be meshed for that.

    Parameters
    ----------
    pad : PadFile
        The pad.
    mesh_size : float or None
        Mesh size in mm, None for the default of the pad.

    Returns
    -------
    pad : (2, 3) ndarray
        Lowest and highest coordinates of the pad, in mm.
    cells : (K, 2, 3) ndarray
        Lowest and highest coordinates of each of K cells, in mm.

    Raises
    ------
    InputError
        as `mesh_pad_file`.
    """
    from mitsuba_taxel.geometry.geometry_error import GeometryError
    from mitsuba_taxel.geometry.surfaces.triangles import volume
    from mitsuba_taxel.pads.imported.regions import extents_of
    from mitsuba_taxel.pads.imported.surface_meshing import surface_of
    from mitsuba_taxel.pads.imported.surfaces import check_mesh_size

    size = mesh_size or pad.default_mesh_size
    if pad.is_drawn:
        mesh = pad.mesh(size)
        return extents_of(mesh.points[mesh.faces], mesh.face_cell)
    try:
        surface = surface_of(pad.content(), pad.suffix, pad.regions, pad.placement)
    except GeometryError as error:
        raise InputError(f"filename = {pad.path} is not allowed: {error}.") from error
    check_mesh_size(size, volume(surface.vertices, surface.triangles))
    return extents_of(surface.vertices[surface.triangles], surface.cell)


def refuse_finish(pad: Pad, mesh_size: float | None, finish: Finish | SeparateFinish, subdivision: int) -> None:
    """Refuse a finish that a pad cannot have; the number of triangles follows from the mesh.

    Failures of meshing itself are not reported here.

    Parameters
    ----------
    pad : Pad
        The pad.
    mesh_size : float or None
        Mesh size in mm, None for the default of the pad.
    finish : Finish or SeparateFinish
        Roughness or texture of its surface.
    subdivision : int
        Subdivision of the surface triangles.

    Raises
    ------
    InputError
        as `check_finish`.
    """
    from mitsuba_taxel.mechanics import check_finish

    try:
        check_finish(finish, pad, pad.mesh(mesh_size or pad.default_mesh_size), subdivision)
    except ComputationError:
        pass
