"""Adaptation of a volume mesh to the borders between regions on a smooth surface, which the mesher does not know."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.second_order import boundary_triangles
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, neighbours, unit
from mitsuba_taxel.pads.imported.triangles.snapping import LEAST_VOLUME, Patches, volumes

NEAR_END = 0.3
"""If a border crosses an edge within this fraction of its length from an end, the end is moved, else the edge is cut.
"""
BISECTIONS = 30


def conforming(points: np.ndarray, tets: np.ndarray, patches: Patches, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Move nodes, and cut elements, so that no face lies across a border of regions.

    Parameters
    ----------
    points : (N, 3) ndarray
        Nodes, mm.
    tets : (M, 4) ndarray of int
        Straight, positively oriented tetrahedra.
    patches : Patches
        Patches of the surface.
    reach : float
        Largest distance of the mesh from the surface, mm.

    Returns
    -------
    points : (O, 3) ndarray
        Nodes, mm.
    tets : (P, 4) ndarray of int
        Tetrahedra.
    """
    faces = boundary_triangles(tets)
    normals = unit(area_normals(points, faces))
    triangle = patches.nearest_triangle(points[faces].mean(axis=1), normals, reach)
    edges, pairs = neighbours(faces)
    sheet = patches.sheet[triangle]
    smooth = sheet[pairs[:, 0]] == sheet[pairs[:, 1]]
    smooth &= np.isin(sheet[pairs[:, 0]], patches.sheets_with_borders)
    edges, normals, sheet = edges[smooth], unit(normals[pairs[smooth]].sum(axis=1)), sheet[pairs[smooth, 0]]

    def patch_at(fraction: np.ndarray) -> np.ndarray:
        along = points[edges[:, 0]] + fraction[:, None] * (points[edges[:, 1]] - points[edges[:, 0]])
        return patches.patch[patches.nearest_triangle(along, normals, reach, sheet)]

    low, high = np.zeros(len(edges)), np.ones(len(edges))
    start = patch_at(low)
    crossing = start != patch_at(high)
    for _ in range(BISECTIONS if crossing.any() else 0):
        middle = 0.5 * (low + high)
        before = patch_at(middle) == start
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    edges, fraction = edges[crossing], 0.5 * (low + high)[crossing]
    crossing_points = points[edges[:, 0]] + fraction[:, None] * (points[edges[:, 1]] - points[edges[:, 0]])
    points, on_border = _moved_to_borders(points, tets, edges, fraction, crossing_points)
    cut = ~on_border[edges].any(axis=1)
    return _cut(points, tets, edges[cut], crossing_points[cut])


def _moved_to_borders(
    points: np.ndarray, tets: np.ndarray, edges: np.ndarray, fraction: np.ndarray, crossing_points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Move nodes to nearby points where a border crosses an edge of the mesh, unless this squeezes an element. Returns
    the nodes, and a mask (N,) of those that were moved."""
    result, on_border = points.copy(), np.zeros(len(points), dtype=bool)
    before = volumes(points, tets)
    close = np.minimum(fraction, 1 - fraction)
    for number in np.argsort(close, kind="stable"):
        if close[number] > NEAR_END:
            break
        node = edges[number, int(fraction[number] > 0.5)]
        if on_border[edges[number]].any():
            continue
        result[node] = crossing_points[number]
        touched = np.any(tets == node, axis=1)
        on_border[node] = np.all(volumes(result, tets[touched]) >= LEAST_VOLUME * before[touched])
        if not on_border[node]:
            result[node] = points[node]
    return result, on_border


def _cut(points: np.ndarray, tets: np.ndarray, edges: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut the tetrahedra along edges (E, 2) in two, at the ``new`` nodes (E, 3) on these edges. Returns the resulting
    mesh."""
    for number, (start, end) in enumerate(edges.tolist(), start=len(points)):
        along = np.any(tets == start, axis=1) & np.any(tets == end, axis=1)
        half = tets[along]
        first, second = np.where(half == end, number, half), np.where(half == start, number, half)
        tets = np.concatenate([tets[~along], first, second])
    return np.concatenate([points, new]), tets
