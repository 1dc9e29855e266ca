"""Rigid bodies that a pad may touch, such as packages."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.point_tree import PointTree

CONVEX, COINCIDENT = 1e-5, 1e-6
"""Tolerances for corners in single precision: of the volume of a convex body, relative to that of its convex hull, and
of the distance of a point from a plane, relative to the largest coordinate."""


def body_of_each(triangles: np.ndarray) -> np.ndarray:
    """Number (K,) of the body to which each of K triangles belongs; triangles that share a corner belong to one body.

    Parameters
    ----------
    triangles : (K, 3, 3) ndarray
        Corners, mm.

    Returns
    -------
    (K,) ndarray of int
        Number of the body of each triangle, from 0.
    """
    number = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    sides = number[:, [0, 1]].ravel(), number[:, [1, 2]].ravel()
    joined = coo_array((np.ones(len(sides[0])), sides), shape=(number.max() + 1,) * 2)
    return connected_components(joined, directed=False)[1][number[:, 0]]


@dataclass(frozen=True)
class RigidBodies:
    """Closed surfaces that do not move; two objects with the same triangles are equal.

    Attributes
    ----------
    corners : bytes
        Bytes of the array (K, 3, 3) of the corners of K triangles, in mm in the frame of the pad.
    """

    corners: bytes

    @cached_property
    def triangles(self) -> np.ndarray:
        """Corners (K, 3, 3) of the K triangles in mm."""
        return np.frombuffer(self.corners).reshape(-1, 3, 3)

    @cached_property
    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """P vertices (P, 3) in mm, and the vertex numbers (T, 3) of T triangles.

        The faces of a convex body are triangulated again, so that the triangles have the symmetries of the body.
        """
        points, triangles, count = [], [], 0
        for body in self._parts:
            points.append(body.points)
            triangles.append(count + body.triangles)
            count += len(body.points)
        return np.concatenate(points), np.concatenate(triangles)

    def kept_by(self, mirror: Mirror) -> bool:
        """Whether the bodies are symmetric about the plane of a mirror. The answer is False if a body is not convex,
        because its symmetry is not tested.
        """
        if not all(body.is_convex for body in self._parts):
            return False
        points, _ = self.surface
        distance, _ = PointTree(points).query(mirror.image(points))
        return bool((distance <= self._tolerance).all())

    @cached_property
    def _tolerance(self) -> float:
        return COINCIDENT * float(np.abs(self.triangles).max())

    @cached_property
    def _parts(self) -> list[_Part]:
        body = body_of_each(self.triangles)
        return [_part(self.triangles[body == number], self._tolerance) for number in range(body.max() + 1)]


class _Part(NamedTuple):
    """P vertices (P, 3) in mm and the vertex numbers (T, 3) of T triangles of one body."""

    points: np.ndarray
    triangles: np.ndarray
    is_convex: bool


def _part(triangles: np.ndarray, tolerance: float) -> _Part:
    points, number = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    hull = ConvexHull(points)
    if abs(np.linalg.det(triangles - points.mean(axis=0)).sum() / 6) < (1 - CONVEX) * hull.volume:
        return _Part(points, number.reshape(-1, 3), False)
    return _Part(*_fans(hull, tolerance), True)


def _fans(hull: ConvexHull, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of the surface of a convex body: each plane face is divided into triangles that meet at
    its centre."""
    in_plane = hull.points @ hull.equations[:, :3].T + hull.equations[:, 3] > -tolerance
    faces = np.unique(in_plane, axis=1).T
    size, common = faces.sum(axis=1), faces.astype(int) @ faces.T.astype(int)
    faces = faces[~((common == size[:, None]) & (size > size[:, None])).any(axis=1)]  # without slivers along an edge
    corner = faces.sum(axis=0) >= 3  # points in fewer planes are inside a face or an edge
    number = np.cumsum(corner) - 1
    points, triangles, middle = [hull.points[corner]], [], hull.points[corner].mean(axis=0)
    for count, face in enumerate(faces, start=int(corner.sum())):
        around = np.flatnonzero(face & corner)
        centre = hull.points[around].mean(axis=0)
        x, y, normal = np.linalg.svd(hull.points[around] - centre)[2]
        if np.linalg.det([x, y, normal]) * (normal @ (centre - middle)) < 0:
            x = -x
        angle = np.arctan2((hull.points[around] - centre) @ y, (hull.points[around] - centre) @ x)
        sides = number[around[np.argsort(angle)]]
        points.append(centre[None])
        triangles.append(np.stack([np.full(len(sides), count), sides, np.roll(sides, -1)], axis=1))
    return np.concatenate(points), np.concatenate(triangles)
