"""A k-d tree of points that is safe in threads without denormal numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


class PointTree:
    """scipy's ``cKDTree`` of points (N, 3), shifted to positive coordinates.

    Mitsuba builds plugins in threads that flush denormal numbers to zero. There the construction of scipy's tree never
    ends if many points share a coordinate of 0, as it fails to step to the next larger number.
    """

    def __init__(self, points: np.ndarray) -> None:
        from scipy.spatial import cKDTree  # a scene without a pad has no use for it

        size = float(np.ptp(points, axis=0).max()) or 1.0
        self._shift = size - points.min(axis=0)
        self._tree = cKDTree(points + self._shift)

    def query(
        self, points: np.ndarray, k: int | Sequence[int] | np.ndarray = 1, within: float = np.inf
    ) -> tuple[np.ndarray, np.ndarray]:
        """Distances and numbers of the nearest points within a distance; see scipy."""
        distance, number = self._tree.query(points + self._shift, k=k, distance_upper_bound=within)
        return np.asarray(distance), np.asarray(number)

    def query_ball_point(self, points: np.ndarray, radius: Any) -> np.ndarray:
        """Numbers of the points within a radius; see scipy."""
        return self._tree.query_ball_point(points + self._shift, radius)

    def count_pairs(self, radius: float) -> int:
        """Number of pairs of points within a radius of each other: the length of the result of :meth:`query_pairs`."""
        return (int(self._tree.count_neighbors(self._tree, radius)) - self._tree.n) // 2

    def query_pairs(self, radius: float) -> np.ndarray:
        """Numbers (K, 2) of points within a radius of each other."""
        return self._tree.query_pairs(radius, output_type="ndarray")
