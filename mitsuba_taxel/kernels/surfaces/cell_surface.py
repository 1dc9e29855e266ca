"""The undeformed surface of a pad, which gives its triangles an order that is independent of the load."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True, eq=False)
class CellSurface:
    """N triangles of a surface with their regions and cells; caches identify a surface by its object identity.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        World coordinates, mm.
    triangles : (N, 3) ndarray
        Numbers of vertices.
    region, cell : (N,) ndarray
        Code of the region and number of the cell of each triangle; cells count from 1.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    region: np.ndarray
    cell: np.ndarray

    @cached_property
    def middles(self) -> np.ndarray:
        """Mean position of the triangles of each cell, in mm, as an array (largest cell number + 1, 3). Row 0 belongs
        to triangles without a cell.
        """
        cell = np.maximum(self.cell, 0)
        count = np.maximum(np.bincount(cell), 1)
        columns = self.vertices[self.triangles].mean(axis=1).T
        return np.stack([np.bincount(cell, column) / count for column in columns], axis=1)
