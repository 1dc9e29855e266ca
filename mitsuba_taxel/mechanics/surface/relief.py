"""A rough surface relative to the smooth surface of an undeformed pad, with whose deformation it moves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.pads.regions import REGIONS


@dataclass(frozen=True, eq=False)
class SmoothSurface:
    """The closed surface of an undeformed pad, with fields as in :class:`Surface`."""

    vertices: np.ndarray
    triangles: np.ndarray
    region: np.ndarray

    @cached_property
    def in_cell(self) -> np.ndarray:
        """(T,) whether each triangle belongs to a roof or side."""
        return np.isin(self.region, (REGIONS["roof"], REGIONS["side"]))

    @cached_property
    def unit_offset(self) -> np.ndarray:
        """(V, 3) movement of each vertex of a cell if its walls move by 1 out of the silicone; 0 elsewhere.

        On a smooth wall it is the angle-weighted normal; at an edge both walls stay plane. The edge at the board moves
        along the board.
        """
        triangles = self.triangles[self.in_cell]
        corner = self.vertices[triangles]
        edge_vectors = np.roll(corner, -1, axis=1) - corner
        edge_vectors /= np.linalg.norm(edge_vectors, axis=2, keepdims=True)
        angle = np.arccos(np.clip(-np.einsum("tki,tki->tk", edge_vectors, np.roll(edge_vectors, 1, axis=1)), -1, 1))
        normal = np.cross(edge_vectors[:, 0], edge_vectors[:, 1])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        mean = np.zeros((len(self.vertices), 3))
        for axis in range(3):
            weighted = (angle * normal[:, axis, None]).ravel()
            mean[:, axis] = np.bincount(triangles.ravel(), weights=weighted, minlength=len(mean))
        total = np.bincount(triangles.ravel(), weights=angle.ravel(), minlength=len(mean))
        mean[self.vertices[:, 2] == 0, 2] = 0
        used = total > 0
        mean[used] /= total[used, None]
        mean[used] /= np.einsum("vi,vi->v", mean[used], mean[used])[:, None]
        return mean


@dataclass(frozen=True, eq=False)
class Relief:
    """A closed rough surface, relative to a :class:`SmoothSurface`.

    Attributes
    ----------
    low, high, fraction : (V,) ndarray
        Two vertices of the smooth surface, and the fraction of the distance between them, for each vertex.
    offset : (V, 3) ndarray
        Undeformed vector in mm from that point to the vertex.
    triangles : (T, 3) ndarray
        Vertex numbers.
    parents : (T,) ndarray
        Triangle of the smooth surface of which each has the region and cell.
    """

    low: np.ndarray
    high: np.ndarray
    fraction: np.ndarray
    offset: np.ndarray
    triangles: np.ndarray
    parents: np.ndarray

    def carried(self, position: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """The deformed rough surface: x = x_smooth + F (X_rough - X_smooth).

        Parameters
        ----------
        position : (V', 3) ndarray
            Deformed vertices of the smooth surface, mm.
        gradient : (V', 3, 3) ndarray
            Of the displacement, F - 1, at these vertices.

        Returns
        -------
        (V, 3) ndarray
            Deformed vertices, mm.
        """
        stretch = np.einsum("vij,vj->vi", self.between(gradient), self.offset)
        return self.between(position) + self.offset + stretch

    def between(self, values: np.ndarray) -> np.ndarray:
        """(V, ...) values at the vertices from those at the vertices of the smooth surface (V', ...)."""
        fraction = self.fraction.reshape(-1, *(1,) * (values.ndim - 1))
        return values[self.low] + fraction * (values[self.high] - values[self.low])
