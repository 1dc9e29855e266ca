"""Project the boundary of a mesh onto the surface that it was made from.

The surface is divided into smooth patches; two meet in a curve, more in a corner. A node whose boundary triangles
follow one patch belongs on it, one between two patches on their curve, one between more at their corner.
"""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.geometry.element_maps import jacobians
from mitsuba_taxel.geometry.second_order import edge_ends
from mitsuba_taxel.geometry.surfaces.triangles import (
    area_normals,
    closest_on_segments,
    closest_on_triangles,
    components,
    first_of_each,
    near,
    neighbours,
    unit,
)
from mitsuba_taxel.pads.imported.triangles.repair import is_sliver

CREASE_ANGLE = 35.0
"""Degrees between the normals of neighbouring triangles above which their edge is sharp."""
REACH = 0.5
"""Largest displacement of a node, relative to the mesh size."""
NEARER = np.array([1 / 64, 1 / 16, 1 / 4, 1])
"""Shares of that within which the surface is searched for in turn, as there may be many fine triangles far away."""
LEAST_VOLUME = 0.25
"""Least volume of an element after its corners are moved, relative to its volume before."""
LEAST_QUALITY = 0.25
"""Least determinant of the map of a curved element, relative to that of the straight one."""


class Patches:
    """Smooth patches of a surface, each within one region and cell, and the curves and corners where they meet."""

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray, region: np.ndarray, cell: np.ndarray) -> None:
        self.vertices, self.triangles = vertices, triangles
        self.normals = unit(area_normals(vertices, triangles))
        edges, pairs = neighbours(triangles)
        one, other = pairs.T
        flat = is_sliver(vertices, triangles)
        cosine = np.einsum("ij,ij->i", self.normals[one], self.normals[other])
        smooth = (cosine > math.cos(math.radians(CREASE_ANGLE))) | flat[one] | flat[other]
        same = smooth & (region[one] == region[other]) & (cell[one] == cell[other])
        self.patch = components(len(triangles), pairs[same])
        self.sheet = components(len(triangles), pairs[smooth])
        self.sheets_with_borders = np.unique(self.sheet[one[smooth & ~same]])
        self.count = int(self.patch.max()) + 1
        meeting = self.patch[one] != self.patch[other]
        self.curves, self.curve_patches = edges[meeting], self.patch[pairs[meeting]]

        at = np.zeros((len(vertices), self.count), dtype=bool)
        at[triangles.ravel(), np.repeat(self.patch, 3)] = True
        self.corners = np.flatnonzero(at.sum(axis=1) > 2)
        self.corner_patches = at[self.corners]

    def nearest_triangle(
        self, points: np.ndarray, normals: np.ndarray, reach: float, sheet: np.ndarray | None = None
    ) -> np.ndarray:
        """Number (N,) of the nearest triangle to each point (N, 3) that faces along ``normals`` (N, 3).

        Given ``sheet`` (N,), only triangles of that smooth sheet of patches are considered.
        """
        found = np.full(len(points), -1)
        while np.any(found < 0):
            missing = np.flatnonzero(found < 0)
            corners = self.vertices[self.triangles]
            point, triangle = near(points[missing], corners, reach)
            point = missing[point]
            if sheet is not None:
                fits = sheet[point] == self.sheet[triangle]
                point, triangle = point[fits], triangle[fits]
            distance = np.linalg.norm(closest_on_triangles(points[point], corners[triangle]) - points[point], axis=1)
            turned = 1 - np.einsum("ij,ij->i", normals[point], self.normals[triangle])
            best = first_of_each(point, distance + 0.5 * reach * turned)
            found[point[best]] = triangle[best]
            reach *= 4
        return found

    def onto_surface(self, points: np.ndarray, belongs: np.ndarray, reach: float) -> np.ndarray:
        """Points (N, 3), projected onto the nearest of the patches that they belong to (N, patches), if within
        reach."""
        corners, result = self.vertices[self.triangles], points.copy()
        sought = np.flatnonzero(belongs.any(axis=1))
        for within in reach * NEARER:
            point, triangle = near(points[sought], corners, within)
            fits = belongs[sought[point], self.patch[triangle]]
            point, triangle = point[fits], triangle[fits]
            closest = closest_on_triangles(points[sought[point]], corners[triangle])
            best = _nearest(points[sought], point, closest, within)
            result[sought[point[best]]] = closest[best]
            sought = np.delete(sought, point[best])
        return result

    def onto_features(self, points: np.ndarray, belongs: np.ndarray, reach: float) -> np.ndarray:
        """Points, those between patches projected onto their curves, or onto the corner where all of them meet."""
        result = points.copy()
        many = np.flatnonzero(belongs.sum(axis=1) > 1)
        ends = self.vertices[self.curves]
        point, curve = near(points[many], ends, reach)
        fits = np.all(belongs[many[point][:, None], self.curve_patches[curve]], axis=1)
        point, curve = point[fits], curve[fits]
        closest = closest_on_segments(points[many[point]], ends[curve, 0], ends[curve, 1])
        result[many] = _moved(points[many], point, closest, reach)

        many = np.flatnonzero(belongs.sum(axis=1) > 2)
        places = self.vertices[self.corners]
        point, corner = near(points[many], places[:, None], reach)
        fits = np.all(~belongs[many[point]] | self.corner_patches[corner], axis=1)
        point, corner = point[fits], corner[fits]
        at_corner = _moved(points[many], point, places[corner], reach)
        moved = np.any(at_corner != points[many], axis=1)
        result[many[moved]] = at_corner[moved]
        return result


def _moved(points: np.ndarray, point: np.ndarray, closest: np.ndarray, reach: float) -> np.ndarray:
    """``points`` with the numbers ``point`` (P,) at the nearest of their candidates ``closest`` (P, 3)."""
    best = _nearest(points, point, closest, reach)
    result = points.copy()
    result[point[best]] = closest[best]
    return result


def _nearest(points: np.ndarray, point: np.ndarray, closest: np.ndarray, reach: float) -> np.ndarray:
    """Positions in ``closest`` (P, 3) of the candidate nearest to each of ``points``, of those within reach."""
    distance = np.linalg.norm(closest - points[point], axis=1)
    best = first_of_each(point, distance)
    return best[distance[best] <= reach]


def snapped(
    points: np.ndarray, tets: np.ndarray, faces: np.ndarray, patch: np.ndarray, patches: Patches, mesh_size: float
) -> np.ndarray:
    """Nodes (N, 3) of a mesh of straight elements, with the boundary projected onto the surface.

    ``patch`` (B,) is the patch that each boundary triangle follows. Where an element would be squeezed, its corners are
    moved back to the nearest point of the surface, then to their original positions; its edges become straight again.
    """
    belongs = np.zeros((len(points), patches.count), dtype=bool)
    belongs[faces.ravel(), np.repeat(patch, 6)] = True
    corner_count = int(tets[:, :4].max()) + 1
    reach = REACH * mesh_size
    ends = edge_ends(tets)

    corners = points[:corner_count]
    on_surface = patches.onto_surface(corners, belongs[:corner_count], reach)
    placed = np.stack([corners, on_surface, patches.onto_features(on_surface, belongs[:corner_count], reach)])
    level = np.full(corner_count, 2)
    before = volumes(corners, tets)
    while True:
        corners = placed[level, np.arange(corner_count)]
        squeezed = volumes(corners, tets) < LEAST_VOLUME * before
        nodes = np.unique(tets[squeezed, :4])
        if not np.any(level[nodes] > 0):
            break
        level[nodes] = np.maximum(level[nodes] - 1, 0)

    middles = corners[ends].mean(axis=1)
    outside = belongs[corner_count:]
    curved = patches.onto_features(patches.onto_surface(middles, outside, reach), outside, reach)
    straight = np.zeros(len(ends), dtype=bool)
    while True:
        result = np.concatenate([corners, np.where(straight[:, None], middles, curved)])
        bent = np.unique(tets[jacobians(result, tets).min(axis=1) < LEAST_QUALITY, 4:]) - corner_count
        if np.all(straight[bent]):
            return result
        straight[bent] = True


def volumes(corners: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Volumes (M,) of the straight tetrahedra, in mm3."""
    x = corners[tets[:, :4]]
    return np.linalg.det(x[:, 1:] - x[:, :1]) / 6
