"""Curvature of the walls of cells between the corners of their flat triangles.

A triangle between points of a curved wall is a chord, at a mean distance from the wall proportional to the square of
its size. Light scattered by the wall depends on its mean position, so that triangles displaced by this distance give
the same readings as the wall. A mirror needs the wall's normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.geometry.surfaces.triangles import area_normals, components, neighbours, unit

OWN_DIRECTION = 0.1
"""Sheets that meet at a vertex determine its position along their normals; directions in which these spread by less,
squared and relative to the largest spread, are ignored."""


def smooth_sheets(triangles: np.ndarray, normals: np.ndarray, region: np.ndarray, crease: float) -> np.ndarray:
    """Number (F,) of the smooth sheet of each face.

    Parameters
    ----------
    triangles : (F, 3) ndarray
        Corners.
    normals : (F, 3, 3) ndarray
        Unit normals at the middles of the edges from the first corner to the second, and so on.
    region : (F,) ndarray
        Region of each face; sheets end where it changes.
    crease : float
        Least angle in degrees between the normals of two faces, at the middle of their common edge, of a sharp edge.
    """
    edges, pairs = neighbours(triangles)
    normal = []
    for k in range(2):
        corners = triangles[pairs[:, k]]
        sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2), axis=2)
        side = np.argmax((sides == edges[:, None]).all(axis=2), axis=1)
        normal.append(normals[pairs[:, k], side])
    smooth = np.einsum("ei,ei->e", *normal) > np.cos(np.radians(crease))
    return components(len(triangles), pairs[smooth & (region[pairs[:, 0]] == region[pairs[:, 1]])])


@dataclass(frozen=True, eq=False)
class Corners:
    """The corners of triangles on curved walls.

    Attributes
    ----------
    triangles : (T, 3) ndarray
        Vertex numbers.
    curved : (T,) ndarray
        Whether a triangle is on a curved wall.
    points : (T, 3) ndarray
        Numbers of points, one per vertex and smooth sheet; of curved triangles alone.
    vertex : (P,) ndarray
        The vertex of each point.
    """

    triangles: np.ndarray
    curved: np.ndarray
    points: np.ndarray
    vertex: np.ndarray

    def offsets(self, vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(V, 3) mm by which to move vertices (V, 3) on curved walls, so that triangles have the walls' mean position.

        Each moves by the mean of the triangles around it along the normal of its sheet. Where sheets meet, it moves as
        each of them requires, and stays on flat ones.

        Parameters
        ----------
        normals : (P, 3) ndarray
            Unit normals of the walls at the points.
        """
        by = self._bulge(vertices, normals)
        wish = np.stack([np.bincount(self.vertex, column, len(vertices)) for column in (by[:, None] * normals).T], 1)
        flat = self.triangles[~self.curved]
        beside = np.stack(
            [np.bincount(flat.ravel(), np.repeat(n, 3), len(vertices)) for n in area_normals(vertices, flat).T], axis=1
        )
        sheets = np.bincount(self.vertex, minlength=len(vertices))
        several = np.flatnonzero((sheets > 0) & (sheets + beside.any(axis=1) > 1))
        number = np.full(len(vertices), -1)
        number[several] = np.arange(len(several))
        matrix = unit(beside[several])
        matrix = matrix[:, :, None] * matrix[:, None, :]
        there = normals[number[self.vertex] >= 0]
        np.add.at(matrix, number[self.vertex][number[self.vertex] >= 0], there[:, :, None] * there[:, None, :])
        inverse = np.linalg.pinv(matrix, rcond=OWN_DIRECTION, hermitian=True)
        wish[several] = np.einsum("vij,vj->vi", inverse, wish[several])
        return wish

    def _bulge(self, vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(P,) mm, mean distance of the wall from the triangles around each point, along its normal.

        Between two points a curve bulges by an eighth of the distance times the change of the normal along it, and a
        triangle's mean is a third of those of its edges.
        """
        triangles, points = self.triangles[self.curved], self.points[self.curved]
        along, turn = (np.roll(value, -1, axis=1) - value for value in (vertices[triangles], normals[points]))
        bulge = np.einsum("tki,tki->t", along, turn) / 24
        area = np.linalg.norm(area_normals(vertices, triangles), axis=1)
        total, weighted = (
            np.bincount(points.ravel(), np.repeat(weight, 3), len(self.vertex)) for weight in (area, area * bulge)
        )
        return weighted / total
