"""Cells that lean: their walls are sheared, and the silicone follows up to the top and the outside of the pad.

A node of the upright pad moves in proportion to the height, by `top_x` and `top_y` at `cell_height`; above the cells,
and from the outer cells to the outside, the shift falls linearly to 0. So a leaning pad has the mesh of an upright one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.geometry.second_order import edge_ends
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.parametric.drawn_pad import DrawnPad
from mitsuba_taxel.pads.regions import REGIONS

AXES = {"top_x": 0, "top_y": 1}
"""Coordinate axis of each shift of the tops."""


def leans(pad: DrawnPad) -> bool:
    """Whether the cells of a pad lean: their tops are not above the middles of their mouths."""
    return bool(pad.top_x or pad.top_y)


def leaning(pad: DrawnPad, mesh: VolumeMesh) -> VolumeMesh:
    """Mesh of a pad, from the mesh of the same pad with upright cells.

    Parameters
    ----------
    pad : DrawnPad
        Pad with leaning cells, in mm.
    mesh : VolumeMesh
        Mesh of the upright pad.

    Returns
    -------
    VolumeMesh
        Mesh with the same elements.
    """
    return replace(mesh, points=mesh.points + lean(pad, mesh, mesh.points))


def lean(pad: DrawnPad, mesh: VolumeMesh, upright: np.ndarray) -> np.ndarray:
    """Displacements of nodes from the pad with upright cells to the pad with leaning cells.

    Parameters
    ----------
    pad : DrawnPad
        Pad with leaning cells, in mm.
    mesh : VolumeMesh
        Mesh of the pad; only its elements and regions are used.
    upright : (N, 3) ndarray
        Nodes of the upright pad, mm.

    Returns
    -------
    (N, 3) ndarray
        Displacements in mm.
    """
    return sum((getattr(pad, name) * lean_rate(pad, mesh, upright, name) for name in AXES), start=np.zeros(3))


def lean_rate(pad: DrawnPad, mesh: VolumeMesh, upright: np.ndarray, name: str) -> np.ndarray:
    """Derivative of the displacements by :func:`lean` with respect to `top_x` or `top_y`. Midpoints of straight edges
    remain midpoints.

    Parameters
    ----------
    pad : DrawnPad
        The pad, with lengths in mm.
    mesh : VolumeMesh
        Mesh of the pad; only its elements and regions are used.
    upright : (N, 3) ndarray
        Nodes of the upright pad, mm.
    name : str
        ``top_x`` or ``top_y``.

    Returns
    -------
    (N, 3) ndarray
        Derivative in mm per mm.
    """
    axis, count = AXES[name], mesh.corner_count
    half, wall = _inside_of_outer_edges(pad, axis)
    within = np.clip((half - np.abs(upright[:, axis])) / wall, 0.0, 1.0)
    rate = np.zeros_like(upright)
    rate[:, axis] = _rise(pad, upright[:, 2]) * within
    straight = ~on_round_walls(pad, mesh)[count:]
    rate[count:][straight] = rate[edge_ends(mesh.tets)[straight]].mean(axis=1)
    return rate


def upright_nodes(pad: DrawnPad, mesh: VolumeMesh) -> np.ndarray:
    """Nodes of the pad with upright cells, from the nodes of its mesh: the inverse of :func:`leaning`.

    Parameters
    ----------
    pad : DrawnPad
        The pad, with lengths in mm.
    mesh : VolumeMesh
        Mesh of the pad.

    Returns
    -------
    (N, 3) ndarray
        Positions in mm.
    """
    if not leans(pad):
        return mesh.points
    upright, count = mesh.points.copy(), mesh.corner_count
    for name, axis in AXES.items():
        x, (half, wall) = mesh.points[:, axis], _inside_of_outer_edges(pad, axis)
        shift = getattr(pad, name) * _rise(pad, mesh.points[:, 2])
        inside = x - shift
        near_low, near_high = (-half + (x + half) * wall / (wall + shift), half - (half - x) * wall / (wall - shift))
        leant = np.where(inside < wall - half, near_low, np.where(inside > half - wall, near_high, inside))
        upright[:, axis] = np.where(np.abs(x) < half, leant, x)
    straight = ~on_round_walls(pad, mesh)[count:]
    ends = edge_ends(mesh.tets)[straight]
    upright[count:][straight] = mesh.points[count:][straight] - (mesh.points - upright)[ends].mean(axis=1)
    return upright


def on_round_walls(pad: DrawnPad, mesh: VolumeMesh) -> np.ndarray:
    """Mask of the nodes on curved walls, and on the outside if its edges are rounded.

    Parameters
    ----------
    pad : DrawnPad
        Pad with the shape of the cells.
    mesh : VolumeMesh
        Mesh of the pad.

    Returns
    -------
    (N,) ndarray of bool
        One value for each node.
    """
    codes = [REGIONS[name] for name in (*pad.curved_regions, *(["outer"] if pad.outside is not None else []))]
    on_wall = np.zeros(len(mesh.points), dtype=bool)
    on_wall[mesh.faces[np.isin(mesh.face_region, codes)]] = True
    return on_wall


def _inside_of_outer_edges(pad: DrawnPad, axis: int) -> tuple[float, float]:
    """Distances in mm of the rounded outer edges along an axis: from the middle of the pad, and from the outermost
    cells."""
    radius = 0.0 if pad.outside is None else pad.outside.radius
    return 0.5 * pad.extent[axis] - radius, pad.wall - radius


def _rise(pad: DrawnPad, z: np.ndarray) -> np.ndarray:
    """Shift at heights ``z`` (N,), relative to the shift at `cell_height`.

    It grows linearly up to the top of the cell, and falls linearly to 0 at the top of the pad."""
    assert pad.cell_height is not None
    top = pad.top_of_cell
    above = top / pad.cell_height * (pad.height - z) / (pad.height - top)
    return np.where(z <= top, z / pad.cell_height, above)
