"""Angular laws from tables, as random paths follow them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

STEEPEST = 1.65
"""Largest slope of cosine**n relative to its largest value, times the width of such a law, for n not near 1."""


@dataclass(frozen=True, eq=False)
class TabulatedLaw:
    """A law that is linear in the cosine between nodes.

    Attributes
    ----------
    cosines, values : (N,) ndarray
        At the nodes; cosines increase, up to 1. A first value above 0 is the edge of a cone.
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
        return False

    @property
    def cutoff(self) -> float:
        return float(self.cosines[0])

    def width(self, _: np.ndarray) -> float:
        """As a power of the cosine that falls as steeply has it."""
        return self._width

    @cached_property
    def _width(self) -> float:
        steepest = np.abs(np.diff(self.values) / np.diff(np.arccos(self.cosines))).max()
        return float(self.values.max() / (STEEPEST * steepest)) if steepest else 1.0

    @cached_property
    def _slopes(self) -> np.ndarray:
        return np.diff(self.values) / np.diff(self.cosines)

    def __call__(self, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        piece = np.clip(np.searchsorted(self.cosines, cosine) - 1, 0, len(self._slopes) - 1)
        slope = self._slopes[piece]
        return np.maximum(self.values[piece] + slope * (cosine - self.cosines[piece]), 0), slope
