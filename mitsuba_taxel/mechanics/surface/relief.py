"""A rough surface relative to the smooth surface of an undeformed pad, which moves with the deformation."""

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
        """(V, 3) displacement of each vertex of a cell when its walls move by 1 out of the silicone; 0 elsewhere.

        On a smooth wall it is the angle-weighted normal; at an edge it keeps both walls plane. The edge at the board
        moves along the board.
        """
        triangles = self.triangles[self.in_cell]
        corner = self.vertices[triangles]
        forth = np.roll(corner, -1, axis=1) - corner
        forth /= np.linalg.norm(forth, axis=2, keepdims=True)
        angle = np.arccos(np.clip(-np.einsum("tki,tki->tk", forth, np.roll(forth, 1, axis=1)), -1, 1))
        normal = np.cross(forth[:, 0], forth[:, 1])
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
        Two vertices of the smooth surface and the fraction of the way between them, for each vertex.
    offset : (V, 3) ndarray
        Vector in mm from there to the vertex, undeformed.
    triangles : (T, 3) ndarray
        Vertex numbers.
    parents : (T,) ndarray
        Triangle of the smooth surface with the region and cell of each.
    """

    low: np.ndarray
    high: np.ndarray
    fraction: np.ndarray
    offset: np.ndarray
    triangles: np.ndarray
    parents: np.ndarray

    def carried(self, position: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """(V, 3) deformed vertices in mm, for vertices of the smooth surface at ``position``.

        The offset is transformed by the deformation gradient: x = x_smooth + F (X_rough - X_smooth).

        Parameters
        ----------
        gradient : ndarray
            Of the displacement, F - 1, at the vertices of the smooth surface, (V', 3, 3).
        """
        stretch = np.einsum("vij,vj->vi", self.between(gradient), self.offset)
        return self.between(position) + self.offset + stretch

    def between(self, values: np.ndarray) -> np.ndarray:
        """(V, ...) values at the vertices from those at the vertices of the smooth surface (V', ...)."""
        fraction = self.fraction.reshape(-1, *(1,) * (values.ndim - 1))
        return values[self.low] + fraction * (values[self.high] - values[self.low])
