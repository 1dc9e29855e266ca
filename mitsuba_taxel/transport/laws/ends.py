"""The ends of light paths: LED and phototransistor as weighted points, and their angular laws."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Protocol

import numpy as np


class AngularLaw(Protocol):
    """A function of the cosine of the angle to the normal, for cosines of at least ``cutoff``; 0 below."""

    @property
    def cutoff(self) -> float:
        """Cosine."""

    @property
    def spread(self) -> float:
        """Angle in radians from the normal, outside of which the share :data:`TAIL` of its integral lies at most."""

    def width(self, cosine: np.ndarray) -> np.ndarray | float:
        """Angle in radians over which it varies substantially at these angles."""

    @property
    def has_kinks(self) -> bool:
        """Whether its derivative has steps."""

    @property
    def is_peaked(self) -> bool:
        """Whether it varies much more in some directions than in others."""

    def __call__(self, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Value and derivative, also slightly below the cutoff."""

    def within(self, cosine: np.ndarray) -> np.ndarray:
        """Integral over all directions of at least these cosines; 0 along the normal."""


TAIL = 1e-9
NARROW = 0.5
"""Angle in radians up to which a law lights a spot of a wall."""
FINE, WIDE = 0.3, 2 / 3
"""Largest side of pieces of walls below a narrow beam, and in wide light, relative to their distance from the
phototransistor, times the width of its response: readings are right to 1e-5 then."""
ROUND, POWER = 1.5, 1.5
"""Widths of laws: of one that is even within its spread, relative to that; of a power of the cosine, relative to the
standard deviation of a narrow one."""


@dataclass(frozen=True)
class CosineFactor:
    """factor * cosine**exponent."""

    factor: float
    exponent: float
    cutoff: float = 0.0

    @cached_property
    def spread(self) -> float:
        return math.acos(max(self.cutoff, TAIL ** (1 / (self.exponent + 1))))

    @property
    def has_kinks(self) -> bool:
        return False

    @property
    def is_peaked(self) -> bool:
        return self.spread < NARROW

    def width(self, _: np.ndarray) -> float:
        return min(POWER / math.sqrt(max(self.exponent, 1.0)), ROUND * self.spread)

    def __call__(self, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        above, cosine = cosine > 0, np.maximum(cosine, np.finfo(float).tiny)
        slope = self.factor * self.exponent * cosine ** (self.exponent - 1) if self.exponent else np.zeros_like(cosine)
        return self.factor * cosine**self.exponent, np.where(above, slope, 0)

    def within(self, cosine: np.ndarray) -> np.ndarray:
        power, cosine = self.exponent + 1, np.clip(cosine, max(self.cutoff, np.finfo(float).tiny), 1)
        return -2 * math.pi * self.factor / power * np.expm1(power * np.log(cosine))


def uniform_cone(cosine: float) -> CosineFactor:
    """The density of directions uniform within a cone.

    Parameters
    ----------
    cosine : float
        Of the angle between its axis and its side.

    Returns
    -------
    CosineFactor
        In 1/sr.
    """
    return CosineFactor(1 / (2 * math.pi * (1 - cosine)), 0.0, cosine)


@dataclass(frozen=True, eq=False)
class End:
    """An LED or a phototransistor.

    Attributes
    ----------
    points : (L, 3) ndarray
        In mm.
    weights : (L,) ndarray
        Of an LED, shares of its power; of a phototransistor, areas in mm².
    normal : (3,) ndarray
        Unit normal, in the viewing direction.
    law : AngularLaw
        Of an LED, share of its power per solid angle; of a phototransistor, response relative to the ideal one.
    """

    points: np.ndarray
    weights: np.ndarray
    normal: np.ndarray
    law: AngularLaw

    def __eq__(self, other: object) -> bool:
        return isinstance(other, End) and all(
            np.array_equal(getattr(self, field.name), getattr(other, field.name)) for field in fields(self)
        )

    __hash__ = None  # type: ignore[assignment]

    @property
    def fineness(self) -> float:
        """Largest side of pieces in its light, relative to the distance over which a response varies there."""
        return FINE if self.law.spread < NARROW else WIDE

    def resolved(self, middle: np.ndarray, size: np.ndarray) -> np.ndarray:
        """(M,) mm over which its law varies at pieces with a middle (M, 3) and a size (M,), infinite beyond its spread
        and for laws that vary as slowly as the cosine."""
        width = float(np.min(self.law.width(np.ones(1))))
        if width >= POWER:
            return np.full(len(middle), np.inf)
        around = np.linalg.norm(self.points - self.points.mean(axis=0), axis=1).max()
        away = middle - self.points.mean(axis=0)
        distance = np.linalg.norm(away, axis=1)
        radius = np.arcsin(np.minimum((size + around) / distance, 1))
        within = np.arccos(np.clip(away @ self.normal / distance, -1, 1)) - radius < self.law.spread
        return np.where(within, width * distance, np.inf)
