"""The ends of light paths: LED and phototransistor as weighted points, and their angular laws."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Protocol

import numpy as np


class AngularLaw(Protocol):
    """Interface of an angular law: a function of the cosine of the angle to the normal, which is 0 below the cosine
    ``cutoff``."""

    @property
    def cutoff(self) -> float:
        """Cosine of the largest angle at which the law is not 0."""

    @property
    def spread(self) -> float:
        """Angle in radians from the normal that contains almost all of the law: at most the fraction :data:`TAIL` of
        its integral lies outside.
        """

    def width(self, cosine: np.ndarray) -> np.ndarray | float:
        """Angle in radians over which the law varies substantially near the given cosines."""

    @property
    def has_kinks(self) -> bool:
        """Whether the derivative of the law is discontinuous."""

    @property
    def is_peaked(self) -> bool:
        """Whether the law varies much more in some directions than in others."""

    def __call__(self, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Value of the law at a cosine, and the derivative with respect to the cosine. It is valid slightly below the
        cutoff, too.
        """

    def within(self, cosine: np.ndarray) -> np.ndarray:
        """Integral of the law over all directions whose cosine is at least ``cosine``; 0 for the cosine 1."""


TAIL = 1e-9
"""Fraction of the integral of a law that may lie outside of its spread."""
NARROW = 0.5
"""Spread in radians up to which a law is a narrow beam, which lights a spot of a wall."""
FINE, WIDE = 0.3, 2 / 3
"""Largest side of a piece of a wall, below a narrow beam and in wide light, relative to its distance from the
phototransistor times the width of the response: readings are right to 1e-5 then."""
ROUND, POWER = 1.5, 1.5
"""Width of a law that is uniform within its spread, relative to the spread; width of a power of the cosine, relative to
the standard deviation of its angle where that is small."""


@dataclass(frozen=True)
class CosineFactor:
    """Angular law factor * cosine**exponent, for cosines of at least ``cutoff``; 0 below."""

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
    """The density of directions that are uniformly distributed within a cone.

    Parameters
    ----------
    cosine : float
        Cosine of the angle between the axis and the surface of the cone.

    Returns
    -------
    CosineFactor
        Density in 1/sr.
    """
    return CosineFactor(1 / (2 * math.pi * (1 - cosine)), 0.0, cosine)


@dataclass(frozen=True, eq=False)
class End:
    """An LED or a phototransistor as an end of light paths: L weighted points with an angular law.

    Attributes
    ----------
    points : (L, 3) ndarray
        Positions in mm.
    weights : (L,) ndarray
        Weights of the points: fractions of the power of an LED, or areas in mm² of a phototransistor.
    normal : (3,) ndarray
        Unit normal, in the viewing direction.
    law : AngularLaw
        Angular law: fraction of the power of an LED per solid angle, or response of a phototransistor relative to an
        ideal one.
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
        """Largest allowed side of a piece of wall that this LED lights, relative to the length over which the response
        of the phototransistor varies there.
        """
        return FINE if self.law.spread < NARROW else WIDE

    @property
    def _width(self) -> float:
        """Angle in radians over which the law varies along the normal."""
        return float(np.min(self.law.width(np.ones(1))))

    @property
    def varies_slowly(self) -> bool:
        """Whether the law varies no faster than the cosine."""
        return self._width >= POWER

    def resolved(self, middle: np.ndarray, size: np.ndarray) -> np.ndarray:
        """Length on pieces of walls over which the angular law of this LED or phototransistor varies.

        Parameters
        ----------
        middle : (M, 3) ndarray
            Middle points of the pieces, in mm.
        size : (M,) ndarray
            Radius around the middle within which a piece lies, in mm.

        Returns
        -------
        (M,) ndarray
            Length in mm; infinite for pieces beyond the spread, and for laws that vary as slowly as the cosine.
        """
        if self.varies_slowly:
            return np.full(len(middle), np.inf)
        around = np.linalg.norm(self.points - self.points.mean(axis=0), axis=1).max()
        away = middle - self.points.mean(axis=0)
        distance = np.linalg.norm(away, axis=1)
        radius = np.arcsin(np.minimum((size + around) / distance, 1))
        within = np.arccos(np.clip(away @ self.normal / distance, -1, 1)) - radius < self.law.spread
        return np.where(within, self._width * distance, np.inf)
