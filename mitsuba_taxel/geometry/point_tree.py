"""A k-d tree of points that can be built in any thread."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree


class PointTree:
    """Points (N, 3) by their place, as scipy's ``cKDTree``, with all of them moved to positive coordinates.

    Mitsuba builds plugins in threads that flush denormal numbers to zero. There scipy's tree does not get from a
    coordinate of 0, on which many points may lie, to the next larger number, and never ends.
    """

    def __init__(self, points: np.ndarray) -> None:
        size = float(np.ptp(points, axis=0).max()) or 1.0
        self._shift = size - points.min(axis=0)
        self._tree = cKDTree(points + self._shift)

    def query(self, points: np.ndarray, k: Any = 1) -> tuple[np.ndarray, np.ndarray]:
        """Distances and numbers of the nearest points; see scipy."""
        distance, number = self._tree.query(points + self._shift, k=k)
        return np.asarray(distance), np.asarray(number)

    def query_ball_point(self, points: np.ndarray, radius: Any) -> np.ndarray:
        """Numbers of the points within a radius; see scipy."""
        return self._tree.query_ball_point(points + self._shift, radius)

    def count_pairs(self, radius: float) -> int:
        """Number of pairs within a radius, as :meth:`query_pairs` would give them."""
        return (int(self._tree.count_neighbors(self._tree, radius)) - self._tree.n) // 2

    def query_pairs(self, radius: float) -> np.ndarray:
        """(K, 2) numbers of points within a radius of each other."""
        return self._tree.query_pairs(radius, output_type="ndarray")
