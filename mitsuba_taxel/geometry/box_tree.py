"""Which of many boxes overlap, by a tree that follows them as they move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Level(NamedTuple):
    """Boxes round what the nodes of one level of a tree hold, (2 ** depth, 3) corners each; low > high if nothing."""

    low: np.ndarray
    high: np.ndarray


class BoxTree:
    """Halves of halves of a set of things, as near to each other as their ``centres`` (n, 3) allow."""

    def __init__(self, centres: np.ndarray) -> None:
        depth = max(len(centres) - 1, 0).bit_length()
        leaves = np.minimum(np.arange(2**depth), len(centres) - 1)
        self._order = leaves.reshape(1, -1)
        for _ in range(depth):
            place = centres[self._order]
            longest = np.ptp(place, axis=1).argmax(axis=1)
            key = np.take_along_axis(place, longest[:, None, None], axis=2)[:, :, 0]
            self._order = np.take_along_axis(self._order, np.argsort(key, axis=1, kind="stable"), axis=1)
            self._order = self._order.reshape(2 * len(self._order), -1)
        self._order = self._order[:, 0]
        self._empty = np.ones(len(leaves), dtype=bool)
        self._empty[np.unique(self._order, return_index=True)[1]] = False

    def levels(self, low: np.ndarray, high: np.ndarray) -> list[Level]:
        """Boxes of all nodes, from the root to the leaves, for things in boxes with corners ``low`` and ``high``."""
        empty = self._empty[:, None]
        level = Level(np.where(empty, np.inf, low[self._order]), np.where(empty, -np.inf, high[self._order]))
        levels = [level]
        while len(level.low) > 1:
            level = Level(np.minimum(*_halves(level.low)), np.maximum(*_halves(level.high)))
            levels.insert(0, level)
        return levels

    def overlapping(self, levels: list[Level]) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of two different things whose boxes overlap or touch, each two once."""
        one: np.ndarray = np.zeros(1, dtype=np.int64)
        other = one
        for level in levels[1:]:
            one, other = (2 * one[:, None] + [0, 0, 1, 1]).ravel(), (2 * other[:, None] + [0, 1, 0, 1]).ravel()
            once = one <= other
            one, other = _kept(level, one[once], level, other[once])
        different = one != other
        return self._order[one[different]], self._order[other[different]]

    def overlapping_with(self, levels: list[Level], tree: BoxTree, others: list[Level]) -> tuple[np.ndarray, ...]:
        """Numbers of a thing in this tree and one in another whose boxes overlap or touch."""
        one: np.ndarray = np.zeros(1, dtype=np.int64)
        other = one
        for depth in range(1, max(len(levels), len(others))):
            if depth < len(levels):
                one, other = (2 * one[:, None] + [0, 1]).ravel(), np.repeat(other, 2)
            if depth < len(others):
                one, other = np.repeat(one, 2), (2 * other[:, None] + [0, 1]).ravel()
            one, other = _kept(levels[min(depth, len(levels) - 1)], one, others[min(depth, len(others) - 1)], other)
        one, other = _kept(levels[-1], one, others[-1], other)
        return self._order[one], tree._order[other]


def _halves(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return values[0::2], values[1::2]


def _kept(level: Level, one: np.ndarray, other_level: Level, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pairs of nodes whose boxes overlap."""
    for axis in range(3):
        below = level.low[one, axis] <= other_level.high[other, axis]
        kept = below & (other_level.low[other, axis] <= level.high[one, axis])
        one, other = one[kept], other[kept]
    return one, other
