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
"""Where sheets meet at a vertex, the sum of the dyads of their normals determines how it moves. Directions whose
eigenvalue of this sum is below this fraction of the largest eigenvalue are ignored."""


def smooth_sheets(triangles: np.ndarray, normals: np.ndarray, region: np.ndarray, crease: float) -> np.ndarray:
    """Divide the faces of a surface into smooth sheets: parts without sharp edges.

    Parameters
    ----------
    triangles : (F, 3) ndarray
        Corners of each triangle.
    normals : (F, 3, 3) ndarray
        Unit normals at the middles of the edges from the first corner to the second, and so on.
    region : (F,) ndarray
        Region of each face; sheets end where it changes.
    crease : float
        Angle in degrees between the normals of two faces at the middle of their common edge, above which the edge is
        sharp.

    Returns
    -------
    (F,) ndarray of int
        Number of the smooth sheet of each face.
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
    """The corners of the triangles of a surface, with a separate point for each smooth part (sheet) of the surface at a
    vertex.

    Attributes
    ----------
    triangles : (T, 3) ndarray
        Vertex numbers.
    curved : (T,) ndarray
        Whether a triangle is on a curved wall.
    points : (T, 3) ndarray
        Numbers of points, one per vertex and smooth sheet; of curved triangles only.
    vertex : (P,) ndarray
        The vertex of each point.
    """

    triangles: np.ndarray
    curved: np.ndarray
    points: np.ndarray
    vertex: np.ndarray

    def offsets(self, vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Movements of the V vertices that give the flat triangles the mean position of the curved walls.

        A vertex moves by the mean distance of the triangles around it from the walls, along the normal of its sheet.
        Where sheets meet, it moves as required along the normal of each, and stays on flat sheets.

        Parameters
        ----------
        vertices : (V, 3) ndarray
            Positions in mm.
        normals : (P, 3) ndarray
            Unit normals of the walls at the points.

        Returns
        -------
        (V, 3) ndarray
            Movements in mm.
        """
        bulge = self._bulge(vertices, normals)
        offset = np.stack(
            [np.bincount(self.vertex, column, len(vertices)) for column in (bulge[:, None] * normals).T], 1
        )
        flat = self.triangles[~self.curved]
        flat_normals = np.stack(
            [np.bincount(flat.ravel(), np.repeat(n, 3), len(vertices)) for n in area_normals(vertices, flat).T], axis=1
        )
        sheets = np.bincount(self.vertex, minlength=len(vertices))
        constrained = np.flatnonzero((sheets > 0) & (sheets + flat_normals.any(axis=1) > 1))
        number = np.full(len(vertices), -1)
        number[constrained] = np.arange(len(constrained))
        matrix = unit(flat_normals[constrained])
        matrix = matrix[:, :, None] * matrix[:, None, :]
        normals_there = normals[number[self.vertex] >= 0]
        np.add.at(
            matrix, number[self.vertex][number[self.vertex] >= 0], normals_there[:, :, None] * normals_there[:, None, :]
        )
        inverse = np.linalg.pinv(matrix, rcond=OWN_DIRECTION, hermitian=True)
        offset[constrained] = np.einsum("vij,vj->vi", inverse, offset[constrained])
        return offset

    def _bulge(self, vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Mean distance (P,) in mm, along the normal, of the wall from the triangles around each of P points.

        The mean bulge of a triangle follows from the products of its edge vectors with the changes of the normal along
        them.
        """
        triangles, points = self.triangles[self.curved], self.points[self.curved]
        edge_vectors, turns = (np.roll(value, -1, axis=1) - value for value in (vertices[triangles], normals[points]))
        bulge = np.einsum("tki,tki->t", edge_vectors, turns) / 24
        area = np.linalg.norm(area_normals(vertices, triangles), axis=1)
        total, weighted = (
            np.bincount(points.ravel(), np.repeat(weight, 3), len(self.vertex)) for weight in (area, area * bulge)
        )
        return weighted / total
