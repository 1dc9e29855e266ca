"""The quadratic shape functions of six-node triangles: corners, then edges as in FACE_EDGES."""

from __future__ import annotations

import numpy as np


def shape_functions(barycentric: np.ndarray) -> np.ndarray:
    """(P, 6) values at barycentric coordinates (P, 3)."""
    a, b, c = barycentric.T
    corners = [x * (2 * x - 1) for x in (a, b, c)]
    return np.stack([*corners, 4 * a * b, 4 * b * c, 4 * c * a], axis=1)


def shape_slopes(barycentric: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(P, 6) derivatives along the sides from the first corner to the second and to the third."""
    a, b, c = barycentric.T
    zero = np.zeros_like(a)
    to_second = np.stack([1 - 4 * a, 4 * b - 1, zero, 4 * (a - b), 4 * c, -4 * c], axis=1)
    to_third = np.stack([1 - 4 * a, zero, 4 * c - 1, -4 * b, 4 * b, 4 * (a - c)], axis=1)
    return to_second, to_third
