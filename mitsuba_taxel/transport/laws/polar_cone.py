"""Light that is uniform in the polar angle of a cone, without its pole on the axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

BLUNT = 0.01
"""Largest angle in radians round the axis within which a polynomial replaces the law."""
CHANGE = 0.7
"""Angle over which it varies substantially, relative to that from the axis: the power on a plate is then right to 3e-6,
its derivatives to 3e-4."""


@dataclass(frozen=True)
class PolarCone:
    """The density [1/sr] of directions whose polar angle is uniform in [0, ``angle``]: 1 / (2 pi angle sin(theta)).

    Within :data:`BLUNT` of the axis, or half of the angle, it is a polynomial in cos(theta), with the same value and
    derivatives at the edge, the same power, and the same mean of cos(theta): where it lights no edge of a wall, this
    changes nothing but the fourth moment of light that meets some 0.03 mm.

    Attributes
    ----------
    angle : float
        In radians.
    """

    angle: float

    @property
    def blunt(self) -> float:
        """Angle in radians round the axis within which the polynomial replaces the law."""
        return min(BLUNT, self.angle / 2)

    @property
    def spread(self) -> float:
        return self.angle

    @property
    def has_kinks(self) -> bool:
        return False

    @property
    def is_peaked(self) -> bool:
        return True

    @property
    def cutoff(self) -> float:
        return math.cos(self.angle)

    def width(self, cosine: np.ndarray) -> np.ndarray:
        return CHANGE * np.maximum(np.sqrt(np.maximum((1 - cosine) * (1 + cosine), 0)), self.blunt)

    @property
    def _height(self) -> float:
        """1 - cos(blunt)"""
        return 2 * math.sin(self.blunt / 2) ** 2

    @cached_property
    def _near(self) -> np.ndarray:
        """Coefficients, the highest power first, in (1 - cos(theta)) / (1 - cos(blunt)) = v."""
        room, edge = self._height, np.array(math.cos(self.blunt))
        value, slope = self._beyond(edge)
        bend = (1 + 2 * edge**2) / math.sin(self.blunt) ** 4 * value
        power = np.arange(4, -1, -1)
        conditions = np.stack([np.ones(5), power, power * (power - 1), 1 / (power + 1), 1 / (power + 2)])
        # At v = 1 the value and its derivatives by v; the integrals of the law, and of v times it, over v.
        per_turn = 2 * math.pi * room * self.angle
        means = self.blunt / per_turn, _arc_above_sine(self.blunt) / (room * per_turn)
        return np.linalg.solve(conditions, np.array([value, -room * slope, room**2 * bend, *means]))

    def _beyond(self, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        squared = (1 - cosine) * (1 + cosine)
        value = 1 / (2 * math.pi * self.angle * np.sqrt(squared))
        return value, value * cosine / squared

    def __call__(self, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        room = self._height
        share = (1 - cosine) / room
        value, slope = self._beyond(np.minimum(cosine, 1 - room))
        near = share < 1
        return (
            np.where(near, np.polyval(self._near, share), value),
            np.where(near, -np.polyval(np.polyder(self._near), share) / room, slope),
        )

    def within(self, cosine: np.ndarray) -> np.ndarray:
        """Of the law with its pole."""
        return np.arccos(np.clip(cosine, self.cutoff, 1)) / self.angle


def _arc_above_sine(angle: float) -> float:
    """angle - sin(angle), also for small angles."""
    return angle**3 / 6 * (1 - angle**2 / 20 * (1 - angle**2 / 42 * (1 - angle**2 / 72)))
