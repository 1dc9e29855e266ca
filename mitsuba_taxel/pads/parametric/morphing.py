"""Meshes of pads moved onto pads of other dimensions: elements stay the same, so that what is computed on them does
not jump from one to the next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.element_maps import worst_element
from mitsuba_taxel.geometry.second_order import edge_ends
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.parametric.drawn_pad import DrawnPad
from mitsuba_taxel.pads.parametric.lean import leaning, leans, on_round_walls, upright_nodes
from mitsuba_taxel.pads.parametric.meshing import snapped
from mitsuba_taxel.pads.parametric.solid import is_square

LEAST_QUALITY = 0.1
"""Least determinant of an element's map, relative to that of the straight element: half of what meshes begin with."""
MOST_STRETCH = 3.0
"""Largest ratio of the stretches of an element along any two directions."""


def moved_onto(pad: DrawnPad, origin: DrawnPad, mesh: VolumeMesh) -> VolumeMesh:
    """The mesh of ``origin`` moved onto a pad that differs in its dimensions only.

    Nodes on a wall are on that wall again, at the same relative position; those inside are shifted as by
    :func:`mesh_velocity`, but all the way. Middles of edges that are not on round walls are shifted by as much as the
    ends on average. The mesh keeps its symmetries exactly, unless cells lean.

    Raises
    ------
    ComputationError
        if an element would be inverted, distorted or stretched too much.
    """
    upright = upright_nodes(origin, mesh)
    points = _moved(origin, pad, upright)
    within = mesh.corner_count + np.flatnonzero(~on_round_walls(pad, mesh)[mesh.corner_count :])
    ends = edge_ends(mesh.tets)[within - mesh.corner_count]
    points[within] = upright[within] + (points - upright)[ends].mean(axis=1)
    moved = replace(mesh, points=snapped(points, pad))
    if leans(pad):
        moved = leaning(pad, moved)
    _check(mesh, moved)
    return moved


def _moved(origin: DrawnPad, pad: DrawnPad, upright: np.ndarray) -> np.ndarray:
    """(N, 3) nodes of upright cells where they move to; mirror images of nodes to mirror images, to the last bit."""
    sign = np.where(upright < 0, -1.0, 1.0)
    folded = np.abs(upright)
    swapped = is_square(pad) & (folded[:, 0] < folded[:, 1])
    folded[swapped, :2] = folded[swapped, 1::-1]
    places, image = np.unique(folded, axis=0, return_inverse=True)

    before, after = origin.shape, pad.shape
    shifts = before.shifts(after, places, lambda of: of(after) - of(before))
    moved = snapped(places + shifts, pad)[image.ravel()]
    moved[swapped, :2] = moved[swapped, 1::-1]
    return sign * moved


def _check(mesh: VolumeMesh, moved: VolumeMesh) -> None:
    quality, place = worst_element(moved)
    stretch = stretches(mesh, moved)
    if quality >= LEAST_QUALITY and stretch.max() <= MOST_STRETCH:
        return
    if quality >= LEAST_QUALITY:
        place = moved.points[moved.tets[int(stretch.argmax()), :4]].mean(axis=0)
    x, y, z = place
    raise ComputationError(
        f"the mesh cannot be moved this far: an element near ({x:.3g}, {y:.3g}, {z:.3g}) mm is distorted or "
        f"{MOST_STRETCH:g} times as slender: meshed_as must be closer, or left out."
    )


def stretches(mesh: VolumeMesh, moved: VolumeMesh) -> np.ndarray:
    """(M,) ratio of the largest to the least stretch of each straight element from one mesh to the other."""
    before, after = (each.points[each.tets[:, 1:4]] - each.points[each.tets[:, :1]] for each in (mesh, moved))
    values = np.linalg.svd(np.linalg.solve(before, after), compute_uv=False)
    return values[:, 0] / values[:, 2]
