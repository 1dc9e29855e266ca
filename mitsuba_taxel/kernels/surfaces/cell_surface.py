"""The undeformed surface of a pad, which orders its triangles independently of the load."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True, eq=False)
class CellSurface:
    """Triangles with the cell that each belongs to; caches identify a surface by its object identity.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        In mm, in the world.
    triangles : (N, 3) ndarray
        Vertex numbers.
    region, cell : (N,) ndarray
        Code of the region and number of the cell of each triangle; cells count from 1.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    region: np.ndarray
    cell: np.ndarray

    @cached_property
    def middles(self) -> np.ndarray:
        """(largest cell + 1, 3) mean position of the triangles of each cell."""
        cell = np.maximum(self.cell, 0)
        count = np.maximum(np.bincount(cell), 1)
        columns = self.vertices[self.triangles].mean(axis=1).T
        return np.stack([np.bincount(cell, column) / count for column in columns], axis=1)
