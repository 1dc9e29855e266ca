"""Meshes of pads moved onto pads of other dimensions.

The elements stay the same, so that results on them change smoothly from one pad to the next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.element_maps import worst_element
from mitsuba_taxel.geometry.second_order import edge_ends
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.parametric.drawn_pad import DrawnPad
from mitsuba_taxel.pads.parametric.edge_zones import carried
from mitsuba_taxel.pads.parametric.lean import leaning, leans, on_round_walls, upright_nodes
from mitsuba_taxel.pads.parametric.meshing import snapped
from mitsuba_taxel.pads.parametric.rounding import rounding, sharp_nodes
from mitsuba_taxel.pads.parametric.solid import is_square

LEAST_QUALITY = 0.1
"""Least determinant of an element's map, relative to that of the straight element: half the limit of new meshes."""
MOST_STRETCH = 3.0
"""Largest ratio of the stretches of an element along any two directions."""


def moved_onto(pad: DrawnPad, origin: DrawnPad, mesh: VolumeMesh) -> VolumeMesh:
    """Move the mesh of a pad onto a pad that differs in its dimensions only.

    Nodes on a wall stay on it, at the same relative position. Nodes inside move along the field of
    :func:`mesh_velocity`, but by a finite change. Midpoints of edges off the round walls move by the mean displacement
    of the ends. The mesh keeps its symmetries exactly, unless cells lean.

    Parameters
    ----------
    pad : DrawnPad
        Pad with the new dimensions, in mm.
    origin : DrawnPad
        The pad of the mesh.
    mesh : VolumeMesh
        The undeformed mesh.

    Returns
    -------
    VolumeMesh
        Mesh with the same elements.

    Raises
    ------
    ComputationError
        if an element would be inverted, distorted or stretched too much.
    """
    sharp = sharp_nodes(origin, mesh, upright_nodes(origin, mesh))
    points = _morphed_nodes(origin, pad, sharp)
    midside = mesh.corner_count + np.flatnonzero(~on_round_walls(pad, mesh)[mesh.corner_count :])
    edges = edge_ends(mesh.tets)[midside - mesh.corner_count]
    points[midside] = sharp[midside] + (points - sharp)[edges].mean(axis=1)
    morphed = replace(mesh, points=snapped(points + rounding(pad, mesh, points, origin), pad))
    if leans(pad):
        morphed = leaning(pad, morphed)
    _check_elements(mesh, morphed)
    return morphed


def _morphed_nodes(origin: DrawnPad, pad: DrawnPad, sharp: np.ndarray) -> np.ndarray:
    """Nodes (N, 3) of the target with upright cells and sharp edges.

    Mirror images of nodes move to mirror images, to the last bit."""
    sign = np.where(sharp < 0, -1.0, 1.0)
    folded = np.abs(sharp)
    swapped = is_square(pad) & (folded[:, 0] < folded[:, 1])
    folded[swapped, :2] = folded[swapped, 1::-1]
    nodes, image = np.unique(folded, axis=0, return_inverse=True)

    start, target = origin.shape, pad.shape
    shifts = start.shifts(target, nodes, lambda function: function(target) - function(start))
    morphed = snapped(carried(origin, pad, nodes, nodes + shifts), pad)[image.ravel()]
    morphed[swapped, :2] = morphed[swapped, 1::-1]
    return sign * morphed


def _check_elements(mesh: VolumeMesh, morphed: VolumeMesh) -> None:
    quality, position = worst_element(morphed)
    stretch = stretches(mesh, morphed)
    if quality >= LEAST_QUALITY and stretch.max() <= MOST_STRETCH:
        return
    if quality >= LEAST_QUALITY:
        position = morphed.points[morphed.tets[int(stretch.argmax()), :4]].mean(axis=0)
    x, y, z = position
    raise ComputationError(
        f"the mesh cannot be moved this far: an element near ({x:.3g}, {y:.3g}, {z:.3g}) mm is distorted or "
        f"{MOST_STRETCH:g} times as slender. Choose dimensions for meshed_as that are closer, or leave it out."
    )


def stretches(mesh: VolumeMesh, morphed: VolumeMesh) -> np.ndarray:
    """Distortion of each element between two meshes: the ratio of its largest stretch to its smallest.

    Parameters
    ----------
    mesh, morphed : VolumeMesh
        Two meshes with the same elements.

    Returns
    -------
    (M,) ndarray
        Ratios, at least 1.
    """
    before, after = (state.points[state.tets[:, 1:4]] - state.points[state.tets[:, :1]] for state in (mesh, morphed))
    values = np.linalg.svd(np.linalg.solve(before, after), compute_uv=False)
    return values[:, 0] / values[:, 2]
