"""A box between walls, and the light that it blocks between two points.

Visibility is discontinuous at the silhouette of the box. It is smoothed over segments that run through the box, or miss
it, by a short length, so that the blocked light is a smooth function of positions; gains and losses balance.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import drjit as dr
import numpy as np
from drjit.llvm import Array3f64, Bool, Float64, UInt32

WIDTH = 0.2
"""Length within a box up to which some light passes, relative to its shortest side; with half or a quarter of it,
derivatives change by less than 1e-3."""


@dataclass(frozen=True, eq=False)
class Box:
    """A box that absorbs all incident light.

    Attributes
    ----------
    centre : (3,) ndarray
        In mm.
    axes : (3, 3) ndarray
        Unit vectors along its sides, as rows.
    half : (3,) ndarray
        Half its sides in mm.
    """

    centre: np.ndarray
    axes: np.ndarray
    half: np.ndarray

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Box) and all(
            np.array_equal(getattr(self, field.name), getattr(other, field.name)) for field in fields(self)
        )

    __hash__ = None  # type: ignore[assignment]

    def below_top(self, places: np.ndarray) -> bool:
        """Whether any of ``places`` (..., 3) lies below its top, along its third side."""
        return bool(((places - self.centre) @ self.axes[2] < self.half[2]).any())

    def within(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) points in the frame of the box."""
        return (points - self.centre) @ self.axes.T


class Passage:
    """Share of the light that passes a box on straight segments.

    Parameters
    ----------
    box : Box
    start, d : Array3f64
        Starts of the segments in the frame of the box, and vectors to their ends.
    stands : Bool or bool
        Whether the box can stand in a segment: it does not if an end lies on its faces and sees the other.
    """

    def __init__(self, box: Box, start: Array3f64, d: Array3f64, stands: Bool | bool = True) -> None:
        width = WIDTH * 2 * float(box.half.min())
        self._box, self._d = box, d
        over = [dr.select(dr.abs(part) > dr.epsilon(Float64), dr.rcp(part), 1 / dr.epsilon(Float64)) for part in d]
        ends = [
            [(sign * float(half) - at) * one for sign in (-1, 1)]
            for half, at, one in zip(box.half, start, over, strict=True)
        ]
        self._enter, enter_by = _extreme(dr.maximum, 0.0, [dr.minimum(*pair) for pair in ends])
        self._leave, leave_by = _extreme(dr.minimum, 1.0, [dr.maximum(*pair) for pair in ends])
        self._length = dr.norm(d)
        inside = (self._leave - self._enter) * self._length / width
        inner = dr.clip(inside, -1, 1)
        square = dr.square(inner)
        self.share = dr.select(stands, 0.5 - 0.9375 * inner * (1 - square * (2 / 3 - square / 5)), 1)
        self._slope = dr.select(stands, -0.9375 / width * dr.square(1 - square), 0)
        self._by = [(dr.select(enter_by == k, one, 0), dr.select(leave_by == k, one, 0)) for k, one in enumerate(over)]

    def slopes(self) -> tuple[Array3f64, Array3f64]:
        """Derivatives of the share that passes by the end, and by a common translation of both ends, in world
        coordinates."""
        along = (self._leave - self._enter) / self._length
        by_end = Array3f64(
            *(
                self._slope * (part * along + self._length * (self._enter * first - self._leave * last))
                for part, (first, last) in zip(self._d, self._by, strict=True)
            )
        )
        by_both = Array3f64(*(self._slope * self._length * (first - last) for first, last in self._by))
        return self._turned(by_end), self._turned(by_both)

    def _turned(self, vector: Array3f64) -> Array3f64:
        return Array3f64(
            *(sum(float(a) * part for a, part in zip(axis, vector, strict=True)) for axis in self._box.axes.T)
        )


def _extreme(pick, bound: float, values: list[Float64]) -> tuple[Float64, UInt32]:
    """The extreme of a bound and three values, and the number of the value, 3 for the bound."""
    found = pick(pick(values[0], values[1]), pick(values[2], bound))
    number = dr.full(UInt32, 3, dr.width(found))
    for k, value in enumerate(values):
        number = dr.select(found == value, k, number)
    return found, dr.select(found == bound, 3, number)
