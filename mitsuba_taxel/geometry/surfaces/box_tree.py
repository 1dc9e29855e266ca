"""Overlapping boxes by a binary tree that can be refitted as they move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.geometry.geometry_error import GeometryError

MORTON_BITS = 10
MOST_PAIRS = 15_000_000
"""Largest number of overlapping pairs that a call returns, which limits its memory. A triangle in a mesh of uniform
size overlaps some ten others."""


class TooManyPairs(GeometryError):
    """More than :data:`MOST_PAIRS` pairs of boxes overlap."""


def overlapping(
    lower_a: np.ndarray, upper_a: np.ndarray, lower_b: np.ndarray, upper_b: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of boxes of two sets that overlap.

    Parameters
    ----------
    lower_a, upper_a : (A, 3) ndarray
        Corners of the first set.
    lower_b, upper_b : (B, 3) ndarray
        Corners of the second set.

    Returns
    -------
    a, b : (P,) ndarray of int
        Numbers of the two boxes of each pair.

    Raises
    ------
    TooManyPairs
        if there are too many, as for triangles that all cross each other.
    """
    if not len(lower_a) or not len(lower_b):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    size = max(len(lower_a), len(lower_b))
    first, second = BoxTree(lower_a + upper_a, size), BoxTree(lower_b + upper_b, size)
    return first.overlapping_with(first.levels(lower_a, upper_a), second, second.levels(lower_b, upper_b))


class Level(NamedTuple):
    """Bounding boxes of the nodes of one level of a tree, (2 ** depth, 3) corners each; low > high if empty."""

    low: np.ndarray
    high: np.ndarray


class BoxTree:
    """A binary tree of boxes, in the order of their centres along a Morton curve.

    Parameters
    ----------
    centres : (n, 3) ndarray
        Centres of the boxes, up to a common factor.
    size : int
        Largest number of boxes that the tree must hold, if more than n.
    """

    def __init__(self, centres: np.ndarray, size: int = 0) -> None:
        order = np.argsort(_morton(centres), kind="stable")
        leaves = np.arange(2 ** max(len(centres) - 1, size - 1, 0).bit_length())
        self._order = order[np.minimum(leaves, len(order) - 1)]
        self._empty = leaves >= len(order)

    def levels(self, low: np.ndarray, high: np.ndarray) -> list[Level]:
        """Bounding boxes of all nodes, from the root to the leaves, for boxes with corners ``low`` and ``high``."""
        empty = self._empty[:, None]
        level = Level(np.where(empty, np.inf, low[self._order]), np.where(empty, -np.inf, high[self._order]))
        levels = [level]
        while len(level.low) > 1:
            level = Level(np.minimum(*_halves(level.low)), np.maximum(*_halves(level.high)))
            levels.insert(0, level)
        return levels

    def overlapping(self, levels: list[Level]) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (P,) and (P,) of the boxes of all P pairs of different boxes that overlap or touch, each pair
        once."""
        first: np.ndarray = np.zeros(1, dtype=np.int64)
        second = first
        for level in levels[1:]:
            first, second = (2 * first[:, None] + [0, 0, 1, 1]).ravel(), (2 * second[:, None] + [0, 1, 0, 1]).ravel()
            once = first <= second
            first, second = _kept(level, first[once], level, second[once])
        different = first != second
        return self._order[first[different]], self._order[second[different]]

    def overlapping_with(
        self, levels: list[Level], tree: BoxTree, second_levels: list[Level]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (P,) and (P,) of the boxes of all P pairs of a box of this tree and a box of another tree that
        overlap or touch.

        Raises
        ------
        TooManyPairs
        """
        first: np.ndarray = np.zeros(1, dtype=np.int64)
        second = first
        for depth in range(1, max(len(levels), len(second_levels))):
            if depth < len(levels):
                first, second = (2 * first[:, None] + [0, 1]).ravel(), np.repeat(second, 2)
            if depth < len(second_levels):
                first, second = np.repeat(first, 2), (2 * second[:, None] + [0, 1]).ravel()
            first, second = _kept(
                levels[min(depth, len(levels) - 1)], first, second_levels[min(depth, len(second_levels) - 1)], second
            )
            if len(first) > MOST_PAIRS:
                raise TooManyPairs("too many of its triangles lie across each other; repair the surface")
        first, second = _kept(levels[-1], first, second_levels[-1], second)
        return self._order[first], tree._order[second]


def _halves(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return values[0::2], values[1::2]


def _kept(level: Level, first: np.ndarray, second_level: Level, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Select those pairs of nodes of two trees whose boxes overlap."""
    for axis in range(3):
        below = level.low[first, axis] <= second_level.high[second, axis]
        kept = below & (second_level.low[second, axis] <= level.high[first, axis])
        first, second = first[kept], second[kept]
    return first, second


def _morton(points: np.ndarray) -> np.ndarray:
    """Position (N,) of each of N points (N, 3) along a space-filling Morton curve."""
    extent = np.ptp(points, axis=0)
    cells = (2**MORTON_BITS - 1) * (points - points.min(axis=0)) / np.where(extent > 0, extent, 1.0)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(MORTON_BITS):
        for axis in range(3):
            code |= ((cells[:, axis].astype(np.int64) >> bit) & 1) << (3 * bit + axis)
    return code
