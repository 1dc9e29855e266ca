"""Angular laws from tables, equal to the laws that random paths follow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.transport.laws.ends import NARROW, ROUND, TAIL

STEEPEST = 1.65
"""Largest slope of cosine**n relative to its largest value, times the width of such a law, for n not near 1."""


@dataclass(frozen=True, eq=False)
class TabulatedLaw:
    """A law that is linear in the cosine between nodes.

    Attributes
    ----------
    cosines, values : (N,) ndarray
        Cosines and values at the nodes. Cosines increase up to 1; if the first value is above 0, the law ends there
        with a step.
    """

    cosines: np.ndarray
    values: np.ndarray

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TabulatedLaw) and all(
            np.array_equal(mine, theirs)
            for mine, theirs in ((self.cosines, other.cosines), (self.values, other.values))
        )

    __hash__ = None  # type: ignore[assignment]

    @property
    def has_kinks(self) -> bool:
        return True

    @property
    def is_peaked(self) -> bool:
        return self.spread < NARROW

    @property
    def cutoff(self) -> float:
        return float(self.cosines[0])

    @cached_property
    def spread(self) -> float:
        outside = self._beyond[-1] - self._beyond >= (1 - TAIL) * self._beyond[-1]
        return math.acos(self.cosines[np.flatnonzero(outside)[-1]])

    def width(self, _: np.ndarray) -> float:
        """Angle in radians over which the law varies substantially. It is the width of a power of the cosine with the
        same largest slope.
        """
        return min(self._width, ROUND * self.spread)

    @cached_property
    def _width(self) -> float:
        steepest = np.abs(np.diff(self.values) / np.diff(np.arccos(self.cosines))).max()
        return float(self.values.max() / (STEEPEST * steepest)) if steepest else 1.0

    @cached_property
    def _beyond(self) -> np.ndarray:
        """Integrals (N,) of the law from each of N nodes outwards, over all directions farther from the normal than the
        node.
        """
        means = (self.values[1:] + self.values[:-1]) / 2
        return 2 * math.pi * np.concatenate([[0.0], np.cumsum(means * np.diff(self.cosines))])

    @cached_property
    def _slopes(self) -> np.ndarray:
        return np.diff(self.values) / np.diff(self.cosines)

    def __call__(self, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        piece = np.clip(np.searchsorted(self.cosines, cosine) - 1, 0, len(self._slopes) - 1)
        slope = self._slopes[piece]
        return np.maximum(self.values[piece] + slope * (cosine - self.cosines[piece]), 0), slope

    def within(self, cosine: np.ndarray) -> np.ndarray:
        cosine = np.clip(cosine, self.cutoff, 1)
        piece = np.clip(np.searchsorted(self.cosines, cosine) - 1, 0, len(self._slopes) - 1)
        past = self.cosines[piece + 1] - cosine
        mean = self.values[piece + 1] - self._slopes[piece] * past / 2
        return self._beyond[-1] - self._beyond[piece + 1] + 2 * math.pi * mean * past
