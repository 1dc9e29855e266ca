"""Project the boundary of a mesh onto the surface that it was made from.

The surface is divided into smooth patches. Two patches meet in a curve, three or more in a corner. A node whose
boundary triangles follow one patch belongs on the patch, a node between two patches on their curve, and a node between
more at their corner."""

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
"""Fractions of the reach within which the surface is searched, one after the other: the whole reach may contain many
fine triangles."""
LEAST_VOLUME = 0.25
"""Least volume of an element after its corners are moved, relative to its volume before."""
LEAST_QUALITY = 0.25
"""Least determinant of the map of a curved element, relative to that of the straight one."""


class Patches:
    """Smooth patches of a surface, each within one region and cell, and the curves and corners where they meet.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    region, cell : (T,) ndarray of int
        Code of the region and number of the cell of each triangle.

    Attributes
    ----------
    patch, sheet : (T,) ndarray of int
        Patch of each triangle; sheet of smoothly connected patches.
    sheets_with_borders : (S,) ndarray of int
        Sheets of more than one patch.
    count : int
        Number of patches.
    curves, curve_patches : (E, 2) ndarray of int
        Vertices of the edges between patches, and their two patches.
    corners, corner_patches : (C,) and (C, P) ndarray
        Vertices where more than two patches meet, and whether they are on each patch.
    """

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray, region: np.ndarray, cell: np.ndarray) -> None:
        self.vertices, self.triangles = vertices, triangles
        self.normals = unit(area_normals(vertices, triangles))
        edges, pairs = neighbours(triangles)
        first, second = pairs.T
        flat = is_sliver(vertices, triangles)
        cosine = np.einsum("ij,ij->i", self.normals[first], self.normals[second])
        smooth = (cosine > math.cos(math.radians(CREASE_ANGLE))) | flat[first] | flat[second]
        same_patch = smooth & (region[first] == region[second]) & (cell[first] == cell[second])
        self.patch = components(len(triangles), pairs[same_patch])
        self.sheet = components(len(triangles), pairs[smooth])
        self.sheets_with_borders = np.unique(self.sheet[first[smooth & ~same_patch]])
        self.count = int(self.patch.max()) + 1
        on_curve = self.patch[first] != self.patch[second]
        self.curves, self.curve_patches = edges[on_curve], self.patch[pairs[on_curve]]

        touches = np.zeros((len(vertices), self.count), dtype=bool)
        touches[triangles.ravel(), np.repeat(self.patch, 3)] = True
        self.corners = np.flatnonzero(touches.sum(axis=1) > 2)
        self.corner_patches = touches[self.corners]

    def nearest_triangle(
        self, points: np.ndarray, normals: np.ndarray, reach: float, sheet: np.ndarray | None = None
    ) -> np.ndarray:
        """The nearest triangle to each point, among those that face the same side as the point's normal.

        Parameters
        ----------
        points, normals : (N, 3) ndarray
            Positions in mm, and unit normals.
        reach : float
            Distance of the first search, mm; it is increased until every point has a triangle.
        sheet : (N,) ndarray of int, optional
            Sheet of each point: only its triangles are considered.

        Returns
        -------
        (N,) ndarray of int
            Number of the triangle.
        """
        nearest = np.full(len(points), -1)
        while np.any(nearest < 0):
            missing = np.flatnonzero(nearest < 0)
            corners = self.vertices[self.triangles]
            point, triangle = near(points[missing], corners, reach)
            point = missing[point]
            if sheet is not None:
                fits = sheet[point] == self.sheet[triangle]
                point, triangle = point[fits], triangle[fits]
            distance = np.linalg.norm(closest_on_triangles(points[point], corners[triangle]) - points[point], axis=1)
            turned = 1 - np.einsum("ij,ij->i", normals[point], self.normals[triangle])
            best = first_of_each(point, distance + 0.5 * reach * turned)
            nearest[point[best]] = triangle[best]
            reach *= 4
        return nearest

    def onto_surface(self, points: np.ndarray, belongs: np.ndarray, reach: float) -> np.ndarray:
        """Project points onto the nearest of their patches, if it is within reach.

        Parameters
        ----------
        points : (N, 3) ndarray
            Positions in mm.
        belongs : (N, P) ndarray of bool
            Patches of each point.
        reach : float
            Largest distance, mm.

        Returns
        -------
        (N, 3) ndarray
            Positions in mm.
        """
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
        """Project points that belong to several patches onto the curve or corner where these patches meet, if it is
        within reach.

        Parameters
        ----------
        points : (N, 3) ndarray
            Positions in mm.
        belongs : (N, P) ndarray of bool
            Patches of each point.
        reach : float
            Largest distance, mm.

        Returns
        -------
        (N, 3) ndarray
            Positions in mm; points on one patch are unchanged.
        """
        result = points.copy()
        multiple = np.flatnonzero(belongs.sum(axis=1) > 1)
        ends = self.vertices[self.curves]
        point, curve = near(points[multiple], ends, reach)
        fits = np.all(belongs[multiple[point][:, None], self.curve_patches[curve]], axis=1)
        point, curve = point[fits], curve[fits]
        closest = closest_on_segments(points[multiple[point]], ends[curve, 0], ends[curve, 1])
        result[multiple] = _replaced(points[multiple], point, closest, reach)

        multiple = np.flatnonzero(belongs.sum(axis=1) > 2)
        corner_points = self.vertices[self.corners]
        point, corner = near(points[multiple], corner_points[:, None], reach)
        fits = np.all(~belongs[multiple[point]] | self.corner_patches[corner], axis=1)
        point, corner = point[fits], corner[fits]
        at_corner = _replaced(points[multiple], point, corner_points[corner], reach)
        at_a_corner = np.any(at_corner != points[multiple], axis=1)
        result[multiple[at_a_corner]] = at_corner[at_a_corner]
        return result


def _replaced(points: np.ndarray, point: np.ndarray, closest: np.ndarray, reach: float) -> np.ndarray:
    """Replace points by their nearest candidates. ``point`` (P,) is the number of the point to which each candidate
    ``closest`` (P, 3) belongs; candidates beyond the ``reach`` are ignored."""
    best = _nearest(points, point, closest, reach)
    result = points.copy()
    result[point[best]] = closest[best]
    return result


def _nearest(points: np.ndarray, point: np.ndarray, closest: np.ndarray, reach: float) -> np.ndarray:
    """Choose candidates for points: the rows of ``closest`` (P, 3) that are nearest to their point, numbered by
    ``point`` (P,), and within the ``reach``."""
    distance = np.linalg.norm(closest - points[point], axis=1)
    best = first_of_each(point, distance)
    return best[distance[best] <= reach]


def snapped(
    points: np.ndarray, tets: np.ndarray, faces: np.ndarray, patch: np.ndarray, patches: Patches, mesh_size: float
) -> np.ndarray:
    """Project the boundary of a mesh of straight elements onto the surface.

    If an element would be squeezed, its corners return to the nearest point of the surface, and if this does not help,
    to their original positions. If a curved element would be distorted, its edges become straight again.

    Parameters
    ----------
    points : (N, 3) ndarray
        Nodes, mm.
    tets, faces : (M, 10) and (B, 6) ndarray of int
        Elements and boundary triangles.
    patch : (B,) ndarray of int
        Patch that each boundary triangle follows.
    patches : Patches
        Patches of the surface.
    mesh_size : float
        Length of the edges of elements, mm.

    Returns
    -------
    (N, 3) ndarray
        Nodes, mm.
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
    """Volumes of straight tetrahedra.

    Parameters
    ----------
    corners : (N, 3) ndarray
        Positions in mm.
    tets : (M, 4 or more) ndarray of int
        Corners of each element first.

    Returns
    -------
    (M,) ndarray
        Volumes in mm³, negative for inverted elements.
    """
    x = corners[tets[:, :4]]
    return np.linalg.det(x[:, 1:] - x[:, :1]) / 6
