"""A box between walls, and the light that it blocks between two points.

Visibility is discontinuous at the silhouette of the box. It is smoothed over segments that pass through the box, or
miss it, by a short length, so that the blocked light is a smooth function of positions. Gains and losses of light
balance.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import drjit as dr
import numpy as np
from drjit.llvm import Array3f64, Bool, Float64, UInt32

WIDTH = 0.2
"""Length of a segment within a box up to which some light passes, relative to the shortest side of the box. With half
or a quarter of this length, derivatives change by less than 1e-3."""


@dataclass(frozen=True, eq=False)
class Box:
    """A box that absorbs all incident light.

    Attributes
    ----------
    centre : (3,) ndarray
        Centre in mm.
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

    def below_top(self, positions: np.ndarray) -> bool:
        """Whether any of the ``positions`` (..., 3) lies below the top, whose normal is the third axis."""
        return bool(((positions - self.centre) @ self.axes[2] < self.half[2]).any())

    def to_box(self, points: np.ndarray) -> np.ndarray:
        """Coordinates (N, 3) of N points (N, 3) in the frame of the box."""
        return (points - self.centre) @ self.axes.T


class Passage:
    """Fraction of the light on straight segments between two points that a box does not block.

    Parameters
    ----------
    box : Box
        Box that blocks the light.
    start, d : Array3f64
        Starts of the segments in the frame of the box, and vectors to their ends, in mm.
    can_block : Bool or bool
        Whether the box can block a segment: it cannot if an end lies on its faces and sees the other end.

    Attributes
    ----------
    fraction : Float64
        Fraction that passes, from 0 to 1.
    """

    def __init__(self, box: Box, start: Array3f64, d: Array3f64, can_block: Bool | bool = True) -> None:
        width = WIDTH * 2 * float(box.half.min())
        self._box, self._d = box, d
        # Fractions of the segment at which it crosses the planes of the faces: it enters the box at the last of the
        # three nearer planes, and leaves it at the first of the three farther ones.
        over = [dr.select(dr.abs(side) > dr.epsilon(Float64), dr.rcp(side), 1 / dr.epsilon(Float64)) for side in d]
        crossings = [
            [(sign * float(half) - at) * rate for sign in (-1, 1)]
            for half, at, rate in zip(box.half, start, over, strict=True)
        ]
        self._enter, enter_by = _extreme(dr.maximum, 0.0, [dr.minimum(*pair) for pair in crossings])
        self._leave, leave_by = _extreme(dr.minimum, 1.0, [dr.maximum(*pair) for pair in crossings])
        # The length within the box, negative if the segment misses it, sets the fraction by a smooth step.
        self._length = dr.norm(d)
        inner = dr.clip((self._leave - self._enter) * self._length / width, -1, 1)
        square = dr.square(inner)
        self.fraction = dr.select(can_block, 0.5 - 0.9375 * inner * (1 - square * (2 / 3 - square / 5)), 1)
        self._slope = dr.select(can_block, -0.9375 / width * dr.square(1 - square), 0)
        self._by = [
            (dr.select(enter_by == axis, rate, 0), dr.select(leave_by == axis, rate, 0))
            for axis, rate in enumerate(over)
        ]

    def slopes(self) -> tuple[Array3f64, Array3f64]:
        """Derivatives of the fraction of light that passes the box, in world coordinates, per mm.

        Returns
        -------
        by_end : Array3f64
            Derivatives with respect to the end of the segment.
        by_both : Array3f64
            Derivatives with respect to a common translation of both ends.
        """
        along = (self._leave - self._enter) / self._length
        by_end = [
            self._slope * (side * along + self._length * (self._enter * first - self._leave * last))
            for side, (first, last) in zip(self._d, self._by, strict=True)
        ]
        by_both = [self._slope * self._length * (first - last) for first, last in self._by]
        by_end_world, by_both_world = (
            Array3f64(*(sum(float(a) * b for a, b in zip(axis, vector, strict=True)) for axis in self._box.axes.T))
            for vector in (by_end, by_both)
        )
        return by_end_world, by_both_world


def _extreme(pick, bound: float, values: list[Float64]) -> tuple[Float64, UInt32]:
    """The largest or smallest, as ``pick`` decides, of a bound and three values, and its index among the values. The
    index of the bound is 3.
    """
    extreme = pick(pick(values[0], values[1]), pick(values[2], bound))
    index = dr.full(UInt32, 3, dr.width(extreme))
    for k, value in enumerate(values):
        index = dr.select(extreme == value, k, index)
    return extreme, dr.select(extreme == bound, 3, index)
