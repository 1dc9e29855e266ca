"""The symmetric part of a pad as an OpenCascade solid with named faces, and its singular edges."""

from __future__ import annotations

from typing import Any

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.parametric.drawn_pad import DrawnPad
from mitsuba_taxel.pads.regions import REGIONS

SYMMETRY = "symmetry"
"""Name of the faces along which the part was cut from the pad."""


def is_square(pad: DrawnPad) -> bool:
    """Whether the pad has as many rows as columns."""
    return pad.rows == pad.columns


def symmetric_part(pad: DrawnPad) -> Any:
    """The symmetric part of a pad as a ``netgen.occ`` shape: 0 <= y <= x if the pad is square, else x, y >= 0.

    Its faces have the names of their regions."""
    from netgen.occ import Box, Pnt

    width, depth, height = pad.extent
    solid = Box(Pnt(0, 0, 0), Pnt(0.5 * width, 0.5 * depth, height))
    for face in solid.faces:
        face.name = _name_of_box_face(face.center, pad)
    if is_square(pad):
        solid = solid - _beyond_diagonal(pad)
    for x, y in pad.cell_centres:
        if min(x, y) > -0.5 * pad.cell_size and not (is_square(pad) and y - x > pad.cell_size):
            solid = solid - pad.shape.solid(x, y)
    return solid


def _beyond_diagonal(pad: DrawnPad) -> Any:
    """A box over y > x, larger than the pad."""
    from netgen.occ import Axis, Box, Pnt, Z

    reach = 2 * sum(pad.extent)
    box = Box(Pnt(-reach, 0, -reach), Pnt(reach, reach, reach)).Rotate(Axis(Pnt(0, 0, 0), Z), 45)
    box.faces.name = SYMMETRY
    return box


def _name_of_box_face(centre: Any, pad: DrawnPad) -> str:
    tolerance = 1e-9 * pad.height
    if min(centre.x, centre.y) < tolerance:
        return SYMMETRY
    if centre.z < tolerance:
        return "bottom"
    return "top" if centre.z > pad.height - tolerance else "outer"


def singular_edges(solid: Any, pad: DrawnPad) -> list[Any]:
    """The edges of the symmetric part where the stress is singular: glued to the board, or re-entrant.

    Edges along a plane of symmetry are left out, and so are smooth rims, as around a hemisphere.

    Parameters
    ----------
    solid : netgen.occ.TopoDS_Shape
        The symmetric part, at any scale.
    pad : DrawnPad
        Pad with its shape of cells.

    Returns
    -------
    list of netgen.occ.Edge
        In the order of the solid.
    """
    cut, side, roof = (
        {edge for face in solid.faces if face.name == name for edge in face.edges}
        for name in (SYMMETRY, "side", "roof")
    )
    height = solid.bounding_box[1].z
    glued = {edge for edge in solid.edges if edge.bounding_box[1].z < 1e-6 * height}
    singular = glued | (side & roof if pad.shape.has_sharp_rim else set())
    if pad.shape.is_square:
        singular |= side | (roof - side if pad.shape.has_ridges else set())
    return [edge for edge in solid.edges if edge in singular and edge not in cut]


def singular_nodes(mesh: VolumeMesh, pad: DrawnPad) -> np.ndarray:
    """Which nodes of the symmetric part's mesh lie on the edges of :func:`singular_edges`.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the symmetric part.
    pad : DrawnPad
        Pad with its shape of cells.

    Returns
    -------
    (N,) ndarray of bool
        One value for each node.
    """
    roof, side, bottom, outer = (_on_region(mesh, name) for name in ("roof", "side", "bottom", "outer"))
    singular = bottom & (side | outer)
    if pad.shape.has_sharp_rim:
        singular |= roof & side
    if pad.shape.is_square:
        x, y = np.abs(mesh.points[:, :2] - _nearest_axis(mesh.points, pad)).T
        singular |= (side | roof & pad.shape.has_ridges) & (np.abs(x - y) < 1e-7 * pad.cell_size)
    return singular


def rounded(mesh: VolumeMesh, pad: DrawnPad) -> np.ndarray:
    """Nodes of a mesh, with those on roofs and curved walls moved exactly onto them.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the upright pad.
    pad : DrawnPad
        Pad with its shape of cells.

    Returns
    -------
    (N, 3) ndarray
        In mm.
    """
    axis = np.column_stack([_nearest_axis(mesh.points, pad), np.zeros(len(mesh.points))])
    on = {name: _on_region(mesh, name) for name in ("roof", "side", "bottom")}
    return pad.shape.rounded(mesh.points, axis, on)


def _nearest_axis(points: np.ndarray, pad: DrawnPad) -> np.ndarray:
    """(N, 2) x and y of the axis of the cell nearest to each of points (N, 3)."""
    from scipy.spatial import cKDTree

    centres = np.array(pad.cell_centres)
    return centres[cKDTree(centres).query(points[:, :2])[1]]


def _on_region(mesh: VolumeMesh, region: str) -> np.ndarray:
    """(N,) which nodes lie on a region of the surface."""
    on = np.zeros(len(mesh.points), dtype=bool)
    on[mesh.faces[mesh.face_region == REGIONS[region]]] = True
    return on
