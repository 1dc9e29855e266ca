"""The symmetric part of a pad as an OpenCascade solid with named faces, and its singular edges."""

from __future__ import annotations

from collections.abc import Callable
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


def symmetric_part(pad: DrawnPad, cell: Callable[[float, float], Any]) -> Any:
    """The symmetric part of a pad: 0 <= y <= x if the pad is square, else x, y >= 0.

    Parameters
    ----------
    pad : DrawnPad
        The pad, with lengths in mm.
    cell : Callable[[float, float], netgen.occ.TopoDS_Shape]
        Returns the cell whose axis is at (x, y), as :meth:`CellShape.solid`.

    Returns
    -------
    netgen.occ.TopoDS_Shape
        Solid whose faces are named by their regions.
    """
    solid = _quadrant(pad)
    if is_square(pad):
        solid = solid - _beyond_diagonal(pad)
    for x, y in pad.cell_centres:
        if min(x, y) > -0.5 * pad.cell_size and not (is_square(pad) and y - x > pad.cell_size):
            solid = solid - cell(x, y)
            if pad.mouth is not None:
                solid = solid - pad.mouth.solid(x, y, -pad.cell_size)
    return solid


def _quadrant(pad: DrawnPad) -> Any:
    """The quadrant x, y >= 0 of the pad as a solid without cells."""
    from netgen.occ import Box, Pnt

    width, depth, height = pad.extent
    if pad.outside is not None:
        part = Box(Pnt(0, 0, -height), Pnt(width, depth, 2 * height))
        part.faces.name = SYMMETRY
        return part * pad.outside.solid()
    solid = Box(Pnt(0, 0, 0), Pnt(0.5 * width, 0.5 * depth, height))
    for face in solid.faces:
        face.name = _name_of_box_face(face.center, pad)
    return solid


def _beyond_diagonal(pad: DrawnPad) -> Any:
    """A box that covers the region y > x of the pad; it is cut off from the quadrant of a square pad."""
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

    Edges along a plane of symmetry are left out, and so are smooth rims, as around a hemisphere or with fillets.

    Parameters
    ----------
    solid : netgen.occ.TopoDS_Shape
        The symmetric part, at any scale.
    pad : DrawnPad
        Pad with its shape of cells.

    Returns
    -------
    list of netgen.occ.Edge
        Singular edges, in the order of the solid.
    """
    cut, side, roof = (
        {edge for face in solid.faces if face.name == name for edge in face.edges}
        for name in (SYMMETRY, "side", "roof")
    )
    height = solid.bounding_box[1].z
    glued = {edge for edge in solid.edges if edge.bounding_box[1].z < 1e-6 * height}
    singular = glued | (side & roof if pad.shape.has_sharp_rim and not pad.fillet else set())
    if pad.shape.is_square and not pad.fillet:
        singular |= side | (roof - side if pad.shape.has_ridges else set())
    return [edge for edge in solid.edges if edge in singular and edge not in cut]


def singular_nodes(mesh: VolumeMesh, pad: DrawnPad) -> np.ndarray:
    """Mask of the nodes of the symmetric part's mesh that lie on the edges of :func:`singular_edges`.

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
    roof, side, bottom, outer = (on_region(mesh, name) for name in ("roof", "side", "bottom", "outer"))
    singular = bottom & (side | outer)
    if pad.fillet:
        return singular
    if pad.shape.has_sharp_rim:
        singular |= roof & side
    if pad.shape.is_square:
        x, y = np.abs(mesh.points[:, :2] - nearest_axis(mesh.points, pad)).T
        singular |= (side | roof & pad.shape.has_ridges) & (np.abs(x - y) < 1e-7 * pad.cell_size)
    return singular


def rounded(mesh: VolumeMesh, pad: DrawnPad) -> np.ndarray:
    """Move the nodes of a mesh on roofs and curved walls exactly onto these surfaces, and return all nodes.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the upright pad.
    pad : DrawnPad
        Pad with its shape of cells.

    Returns
    -------
    (N, 3) ndarray
        Positions in mm.
    """
    axis = np.column_stack([nearest_axis(mesh.points, pad), np.zeros(len(mesh.points))])
    in_mouth = on_mouths(mesh, pad, mesh.points)
    if pad.edges is not None:
        points = mesh.points.copy()
        on_walls = (on_region(mesh, "roof") | on_region(mesh, "side")) & ~in_mouth
        points[on_walls] = axis[on_walls] + pad.edges.onto_wall(points[on_walls] - axis[on_walls])[0]
    else:
        on = {name: on_region(mesh, name) & ~in_mouth for name in ("roof", "side", "bottom")}
        points = pad.shape.rounded(mesh.points, axis, on)
    if pad.mouth is not None:
        points[in_mouth] = axis[in_mouth] + pad.mouth.onto_arc(points[in_mouth] - axis[in_mouth])[0]
    if pad.outside is not None:
        outer = on_region(mesh, "outer")
        points[outer] = pad.outside.onto_rounded(points[outer])
    return points


def on_mouths(mesh: VolumeMesh, pad: DrawnPad, points: np.ndarray) -> np.ndarray:
    """Mask of the nodes on the fillets of mouths.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the pad; only its elements and regions are used.
    pad : DrawnPad
        The pad, with lengths in mm.
    points : (N, 3) ndarray
        Nodes of the pad, with sharp or rounded mouths, mm.

    Returns
    -------
    (N,) ndarray of bool
        Mask of the nodes; none for sharp mouths.
    """
    if pad.mouth is None:
        return np.zeros(len(points), dtype=bool)
    return on_region(mesh, "side") & (points[:, 2] < pad.mouth.height)


def nearest_axis(points: np.ndarray, pad: DrawnPad) -> np.ndarray:
    """The axis of the cell nearest to each point.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    pad : DrawnPad
        Pad with its cells.

    Returns
    -------
    (N, 2) ndarray
        x and y of the axes, mm.
    """
    return np.array(pad.cell_centres)[nearest_cells(points, pad)]


def nearest_cells(points: np.ndarray, pad: DrawnPad) -> np.ndarray:
    """Index of the cell nearest to each point.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    pad : DrawnPad
        Pad with its cells.

    Returns
    -------
    (N,) ndarray of int
        Indices into `cell_centres`.
    """
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(np.array(pad.cell_centres)).query(points[:, :2])[1])


def on_region(mesh: VolumeMesh, region: str) -> np.ndarray:
    """Mask of the nodes that lie on a region of the surface.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the pad.
    region : str
        Name of the region.

    Returns
    -------
    (N,) ndarray of bool
        Mask of the nodes.
    """
    on = np.zeros(len(mesh.points), dtype=bool)
    on[mesh.faces[mesh.face_region == REGIONS[region]]] = True
    return on
