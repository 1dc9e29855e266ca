"""Fillets: meshes of pads whose cells have rounded edges.

Cuboid cells are meshed with fillets that are as wide as elements, and the mesh is moved onto the pad: elements at the
edges become as thin as the fillet, and stay as long.

Round cells are meshed with sharp rims. The elements at the rim are cut so that a layer of them is as thick as the
fillet is wide, and as long as before along the rim; then each node of a wall moves to its image on the rounded wall,
as `pads.cells.rim_fillet` describes it.

So a fillet needs hardly more elements than a sharp edge, however small it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mitsuba_taxel.geometry.refinement import bisected
from mitsuba_taxel.geometry.second_order import edge_ends
from mitsuba_taxel.geometry.volume_mesh import TET_EDGES, VolumeMesh
from mitsuba_taxel.pads.cells.mouth import Mouth
from mitsuba_taxel.pads.cells.rim_fillet import RimFillet
from mitsuba_taxel.pads.parametric.drawn_pad import DrawnPad
from mitsuba_taxel.pads.parametric.grading import cut_towards
from mitsuba_taxel.pads.parametric.outside import Outside
from mitsuba_taxel.pads.parametric.solid import nearest_axis, on_mouths, on_region, rounded, singular_nodes
from mitsuba_taxel.pads.regions import REGIONS

ON_RIM = 1e-6
"""Distance of nodes from a sharp rim, relative to the size of a cell, that counts as zero."""
MOST_CUT = 0.5
"""Largest position of a cut, relative to the length of an element's edge."""


def with_round_rims(mesh: VolumeMesh, pad: DrawnPad, at_sharp_edges: float, marked: bool) -> VolumeMesh:
    """The mesh of a pad with rounded rims, from the mesh of the pad with sharp rims.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the symmetric part of the upright pad with sharp rims.
    pad : DrawnPad
        Pad with its fillet, mm.
    at_sharp_edges : float
        Position of the cut at edges that remain sharp, relative to the length of an element's edge.
    marked : bool
        Whether elements follow the borders of the fillets, so that none need be cut there.

    Returns
    -------
    VolumeMesh
        Mesh with nodes on the exact walls.
    """
    rim, sharp_pad = _rim(pad), pad.with_fillet(0.0)
    mesh = _cut_between_rims(mesh, pad)
    distance = rim.from_rim(_within_cells(pad, mesh.points))
    on_rim = _on_rims(pad, mesh.points)

    def fraction(near: np.ndarray, far: np.ndarray) -> np.ndarray:
        of_fillet = rim.width / np.maximum(distance[far], rim.width)
        return np.where(on_rim[near], np.minimum(of_fillet, MOST_CUT), at_sharp_edges)

    if marked:
        mesh = cut_towards(mesh, singular_nodes(mesh, pad), fraction)
        sharp = _with_round_mouths(mesh, pad)
    else:
        mesh = cut_towards(mesh, singular_nodes(mesh, sharp_pad), fraction)
        sharp = rounded(mesh, sharp_pad)
        # The layer at the rim is on the fillet.
        on_fillet = (mesh.face_region == REGIONS["roof"]) & _on_rims(pad, sharp)[mesh.faces[:, :3]].any(axis=1)
        mesh = replace(mesh, face_region=np.where(on_fillet, REGIONS["side"], mesh.face_region))
        # The border between roof and fillet is a circle, also between the corners.
        border = np.intersect1d(mesh.faces[on_fillet], mesh.faces[mesh.face_region == REGIONS["roof"]])
        sharp[border] = _on_circle(pad, sharp[border], *rim.arc.at(rim.arc.ends[1:])[0][0])
    mesh = replace(mesh, points=sharp + rounding(pad, mesh, sharp))
    # Two elements on each half of a fillet.
    on_rim = _on_rims(pad, sharp_nodes(pad, mesh, mesh.points))
    mesh = cut_towards(mesh, on_rim, 0.5)
    return replace(mesh, points=mesh.points + rounding(pad, mesh, mesh.points))


def _with_round_mouths(mesh: VolumeMesh, pad: DrawnPad) -> np.ndarray:
    """All nodes (N, 3) of a mesh, after the nodes at the mouths of cells have been moved exactly onto the circles of
    the mouths.
    """
    points, mouth = mesh.points.copy(), on_region(mesh, "side") & on_region(mesh, "bottom")
    width = 0.0 if pad.mouth is None else pad.mouth.width
    points[mouth] = _on_circle(pad, points[mouth], 0.5 * pad.cell_size + width, 0.0)
    return points


def _on_circle(pad: DrawnPad, points: np.ndarray, radius: float, height: float) -> np.ndarray:
    """Points (N, 3) moved onto the circle of a radius about the axis of their cell, at a height, mm."""
    axis = nearest_axis(points, pad)
    across = points[:, :2] - axis
    across *= radius / np.linalg.norm(across, axis=1, keepdims=True)
    return np.column_stack([axis + across, np.full(len(points), height)])


def _cut_between_rims(mesh: VolumeMesh, pad: DrawnPad) -> VolumeMesh:
    """Cut all edges inside elements that connect two nodes on rims directly; returns the resulting mesh."""
    while True:
        on_rim = _on_rims(pad, mesh.points)
        count = len(mesh.points)
        ends = np.sort(mesh.tets[:, np.array(TET_EDGES)], axis=2)
        between = on_rim[ends].all(axis=2) & ~on_rim[mesh.tets[:, 4:]]
        if not between.any():
            return mesh
        # At most one edge of each element is cut at a time.
        keys, row = np.unique(ends @ [count, 1], return_inverse=True)
        row = np.where(between, row.reshape(between.shape), -1)
        last = row.max(axis=1, keepdims=True)
        chosen = np.setdiff1d(row[row >= 0], row[(row >= 0) & (row < last)])
        mesh = bisected(mesh, np.stack(np.divmod(keys[chosen], count), axis=1))


def rounding(pad: DrawnPad, mesh: VolumeMesh, sharp: np.ndarray, origin: DrawnPad | None = None) -> np.ndarray:
    """Displacements of nodes from the pad with sharp edges to the pad with rounded edges, both with upright cells.

    Midpoints of straight edges remain midpoints. The rims of cuboid cells stay: `wall_planes` contain their fillets.

    Parameters
    ----------
    pad : DrawnPad
        The pad, with lengths in mm.
    mesh : VolumeMesh
        Mesh of the pad; only its elements and regions are used.
    sharp : (N, 3) ndarray
        Nodes of the pad with sharp edges, mm.
    origin : DrawnPad, optional
        The pad for which the mesh was made: nodes move with the border between roof and fillet.

    Returns
    -------
    (N, 3) ndarray
        Displacements in mm.
    """
    before = None if origin is None else origin.edges

    def onto_wall(rim: RimFillet, points: np.ndarray) -> np.ndarray:
        return rim.onto_wall(rim.slid(points, before) if isinstance(before, RimFillet) else points)[0]

    def onto_arc(mouth: Mouth, points: np.ndarray) -> np.ndarray:
        return mouth.onto_arc(points)[0]

    return _displacement(pad, mesh, sharp, onto_wall, onto_arc, Outside.onto_rounded)


def sharp_nodes(pad: DrawnPad, mesh: VolumeMesh, upright: np.ndarray) -> np.ndarray:
    """Nodes of the pad with sharp edges, from those with rounded edges: the displacements of :func:`rounding` are
    subtracted.

    Parameters
    ----------
    pad : DrawnPad
        The pad, with lengths in mm.
    mesh : VolumeMesh
        Mesh of the pad; only its elements and regions are used.
    upright : (N, 3) ndarray
        Nodes of the upright pad with rounded edges, mm.

    Returns
    -------
    (N, 3) ndarray
        Positions in mm.
    """
    return upright + _displacement(
        pad, mesh, upright, RimFillet.onto_sharp_wall, Mouth.onto_sharp_edge, Outside.onto_sharp
    )


def _displacement(
    pad: DrawnPad,
    mesh: VolumeMesh,
    points: np.ndarray,
    rims: Callable[[RimFillet, np.ndarray], np.ndarray],
    mouths: Callable[[Mouth, np.ndarray], np.ndarray],
    sides: Callable[[Outside, np.ndarray], np.ndarray],
) -> np.ndarray:
    """Displacements (N, 3) of the nodes when edges are rounded. Nodes on walls at rims, on fillets of mouths and on the
    outside are projected; midpoints of edges inside move by the mean of the ends; other nodes do not move.
    """
    displacement, moved = np.zeros_like(points), np.zeros(len(points), dtype=bool)
    in_mouth = on_mouths(mesh, pad, points)
    if isinstance(pad.edges, RimFillet):
        on_walls = (on_region(mesh, "roof") | on_region(mesh, "side")) & ~in_mouth
        within = _within_cells(pad, points[on_walls])
        displacement[on_walls] = rims(pad.edges, within) - within
        moved |= on_walls
    if pad.mouth is not None:
        within = _within_cells(pad, points[in_mouth])
        displacement[in_mouth] = mouths(pad.mouth, within) - within
        moved |= on_region(mesh, "side")
    if pad.outside is not None:
        outer = on_region(mesh, "outer")
        displacement[outer] = sides(pad.outside, points[outer]) - points[outer]
        moved |= outer
    if not moved.any():
        return displacement
    count = mesh.corner_count
    straight = ~moved[count:]
    displacement[count:][straight] = displacement[edge_ends(mesh.tets)[straight]].mean(axis=1)
    return displacement


def _rim(pad: DrawnPad) -> RimFillet:
    assert isinstance(pad.edges, RimFillet)
    return pad.edges


def _within_cells(pad: DrawnPad, points: np.ndarray) -> np.ndarray:
    """Positions (N, 3) of points relative to the middle of the mouth of the nearest cell, mm."""
    return points - np.column_stack([nearest_axis(points, pad), np.zeros(len(points))])


def _on_rims(pad: DrawnPad, points: np.ndarray) -> np.ndarray:
    """Mask (N,) of the points (N, 3) of the pad with sharp rims that lie on a rim."""
    return _rim(pad).from_rim(_within_cells(pad, points)) <= ON_RIM * pad.cell_size
