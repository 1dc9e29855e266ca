"""Which of many boxes along the axes overlap, by descending two trees of boxes at once."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.geometry_error import GeometryError

MORTON_BITS = 10
MOST_PAIRS = 15_000_000
"""Of boxes that overlap, found at once: the memory of one call goes with them. Triangles of even size meet some ten
others each."""


class TooManyPairs(GeometryError):
    """More than :data:`MOST_PAIRS` of boxes overlap."""


def overlapping(
    lower_a: np.ndarray, upper_a: np.ndarray, lower_b: np.ndarray, upper_b: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (P,), (P,) of all pairs of a box of the first set, (A, 3) and (A, 3), and one of the second that overlap.

    The trees are binary, of boxes in the order of their centres along a Morton curve.

    Raises
    ------
    TooManyPairs
        as of triangles that all cross each other.
    """
    depth = int(np.ceil(np.log2(max(len(lower_a), len(lower_b), 1))))
    tree_a, order_a = _tree(lower_a, upper_a, depth)
    tree_b, order_b = _tree(lower_b, upper_b, depth)
    i = j = np.zeros(1, dtype=np.int64)
    for (low_a, high_a), (low_b, high_b) in zip(tree_a, tree_b, strict=True):
        for axis in range(3):
            meet = (low_a[i, axis] <= high_b[j, axis]) & (low_b[j, axis] <= high_a[i, axis])
            i, j = i[meet], j[meet]
        if len(i) > MOST_PAIRS:
            raise TooManyPairs("too many of its triangles lie across each other")
        if len(low_a) < 2**depth:
            i, j = (
                np.repeat(2 * i, 4) + np.tile([0, 0, 1, 1], len(i)),
                np.repeat(2 * j, 4) + np.tile([0, 1], 2 * len(j)),
            )
    return order_a[i], order_b[j]


def _tree(lower: np.ndarray, upper: np.ndarray, depth: int) -> tuple[list[tuple[np.ndarray, np.ndarray]], np.ndarray]:
    """Boxes (2^level, 3), (2^level, 3) of each level, the root first, and the order of those on the last."""
    order = np.argsort(_morton(lower + upper), kind="stable")
    padding = np.full((2**depth - len(order), 3), np.inf)
    levels = [(np.concatenate([lower[order], padding]), np.concatenate([upper[order], -padding]))]
    while len(levels[0][0]) > 1:
        low, high = levels[0]
        levels.insert(0, (np.minimum(low[::2], low[1::2]), np.maximum(high[::2], high[1::2])))
    return levels, order


def _morton(points: np.ndarray) -> np.ndarray:
    """Place (N,) of points (N, 3) along a curve that fills their box."""
    if not len(points):
        return np.empty(0, dtype=np.int64)
    extent = np.ptp(points, axis=0)
    cells = (2**MORTON_BITS - 1) * (points - points.min(axis=0)) / np.where(extent > 0, extent, 1.0)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(MORTON_BITS):
        for axis in range(3):
            code |= ((cells[:, axis].astype(np.int64) >> bit) & 1) << (3 * bit + axis)
    return code
