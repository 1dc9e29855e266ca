"""A rough surface, stored as offsets from the smooth surface of an undeformed pad; it deforms with the smooth surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mitsuba_taxel.pads.regions import REGIONS


@dataclass(frozen=True, eq=False)
class SmoothSurface:
    """The closed surface of an undeformed pad, with fields as in :class:`Surface`.

    Attributes
    ----------
    vertical_sides : bool
        Whether the sides of the cells are vertical.
    walls : tuple[str, ...]
        Regions that get a finish.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    region: np.ndarray
    vertical_sides: bool = True
    walls: tuple[str, ...] = ("roof", "side")

    def with_rough(self, walls: tuple[str, ...]) -> SmoothSurface:
        """The smooth surface of the same pad, with the finish on the regions ``walls`` only."""
        return replace(self, walls=walls)

    @cached_property
    def rough(self) -> np.ndarray:
        """Mask (T,): whether each triangle belongs to a wall that gets a finish."""
        return np.isin(self.region, [REGIONS[wall] for wall in self.walls])

    @cached_property
    def unit_offset(self) -> np.ndarray:
        """Movement (V, 3) of each vertex of the rough walls if they move by 1 out of the silicone; 0 elsewhere.

        On a smooth wall it is the angle-weighted normal; at an edge both walls stay plane. The edge at the board moves
        along the board.
        """
        triangles = self.triangles[self.rough]
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
        mean[self.triangles[self.region == REGIONS["bottom"]], 2] = 0
        used = total > 0
        mean[used] /= total[used, None]
        mean[used] /= np.einsum("vi,vi->v", mean[used], mean[used])[:, None]
        return mean


@dataclass(frozen=True, eq=False)
class Relief:
    """A closed rough surface of V vertices and T triangles, stored as offsets from the smooth surface with its V'
    vertices.

    Attributes
    ----------
    low, high, fraction : (V,) ndarray
        Two vertices of the smooth surface for each vertex, and the fraction of the way from the first to the second.
    offset : (V, 3) ndarray
        Undeformed vector in mm from that point to the vertex.
    triangles : (T, 3) ndarray
        Vertex numbers.
    parents : (T,) ndarray
        Triangle of the smooth surface from which each triangle takes its region and cell.
    base : Relief, optional
        Relief to whose vertices ``low`` and ``high`` refer; by default they refer to the smooth surface.
    """

    low: np.ndarray
    high: np.ndarray
    fraction: np.ndarray
    offset: np.ndarray
    triangles: np.ndarray
    parents: np.ndarray
    base: Relief | None = None

    @classmethod
    def of_vertices(cls, smooth: SmoothSurface, offset: np.ndarray) -> Relief:
        """Rough surface with the triangles of the smooth surface, whose vertices are moved by ``offset`` (V', 3) in mm.
        """
        number = np.arange(len(smooth.vertices))
        return cls(number, number, np.zeros(len(number)), offset, smooth.triangles, np.arange(len(smooth.triangles)))

    def then(self, other: Relief) -> Relief:
        """Combine two finishes: the finish ``other`` is applied to the rough surface of this one."""
        offset = other.offset + other.between(self.offset)
        return replace(other, offset=offset, parents=self.parents[other.parents], base=self)

    def carried(self, position: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """Vertices of the deformed rough surface: x = x_smooth + F (X_rough - X_smooth), with the deformation gradient
        F.

        Parameters
        ----------
        position : (V', 3) ndarray
            Deformed vertices of the smooth surface, mm.
        gradient : (V', 3, 3) ndarray
            Gradient of the displacement, F - 1, at these vertices.

        Returns
        -------
        (V, 3) ndarray
            Deformed vertices, mm.
        """
        stretch = np.einsum("vij,vj->vi", self.between(gradient), self.offset)
        return self.between(position) + self.offset + stretch

    def between(self, values: np.ndarray) -> np.ndarray:
        """Interpolate values (V, ...) at the rough surface's vertices from values (V', ...) at the smooth surface's
        vertices.
        """
        values = values if self.base is None else self.base.between(values)
        fraction = self.fraction.reshape(-1, *(1,) * (values.ndim - 1))
        return values[self.low] + fraction * (values[self.high] - values[self.low])
