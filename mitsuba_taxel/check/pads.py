"""Pads that cannot be meshed, or only with more elements or triangles than fit into memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.pads import Pad, PadFile

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.surface.finish import Finish


def cells_of_file(pad: PadFile, mesh_size: float | None) -> np.ndarray:
    """(K, 2, 3) lowest and highest coordinates, in mm, of the cells of the pad in a file.

    A surface is read, repaired and divided into regions; only a STEP file has to be meshed for that.

    Raises
    ------
    InputError
        as `mesh_pad_file`.
    """
    from mitsuba_taxel.geometry.geometry_error import GeometryError
    from mitsuba_taxel.geometry.triangles import volume
    from mitsuba_taxel.pads.imported.regions import FacedSurface, tagged
    from mitsuba_taxel.pads.imported.repair import faces_of, repaired
    from mitsuba_taxel.pads.imported.surfaces import check_mesh_size, read_surface

    size = mesh_size or pad.default_mesh_size
    if pad.is_drawn:
        mesh = pad.mesh(size)
        return _boxes_of_cells(mesh.points[mesh.faces], mesh.face_cell)
    try:
        vertices, triangles = repaired(*read_surface(pad.content(), pad.suffix, pad.placement))
        surface = FacedSurface(vertices, triangles, faces_of(vertices, triangles))
        _, cell = tagged(surface, pad.regions, pad.placement)
    except GeometryError as error:
        raise InputError(f"filename = {pad.path} is not allowed: {error}.") from error
    check_mesh_size(size, volume(vertices, triangles))
    return _boxes_of_cells(vertices[triangles], cell)


def _boxes_of_cells(corners: np.ndarray, cell: np.ndarray) -> np.ndarray:
    """Extent of each cell, given the corners (T, C, 3) of faces and the cell of each, 0 for none."""
    own = [corners[cell == number].reshape(-1, 3) for number in range(1, int(cell.max()) + 1)]
    return np.array([[places.min(axis=0), places.max(axis=0)] for places in own]).reshape(-1, 2, 3)


def refuse_finish(pad: Pad, mesh_size: float | None, finish: Finish, subdivision: int) -> None:
    """Raise an InputError for a finish that a pad cannot have; its number of triangles is known only from the mesh.

    Failures of meshing itself are not reported here.
    """
    from mitsuba_taxel.mechanics import check_finish

    try:
        check_finish(finish, pad, pad.mesh(mesh_size or pad.default_mesh_size), subdivision)
    except ComputationError:
        pass
