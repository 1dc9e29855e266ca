"""Light exchange between diffuse walls: from a point into its hemisphere, and onto a surface.

All integrals are over surfaces. With d from a point x to a point y of a surface, r = |d|, and the area normal N of the
surface (its length is the area per unit of the integration variables), light emitted isotropically at x arrives there
with -(N . d) / (2 pi r^3), and by Lambert's law with (n . d) (-N . d) / (pi r^4), with the unit normal n at x.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

import drjit as dr
import numpy as np
from drjit.llvm import Array3f64, Bool, Float64, UInt32

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.transport.box import Box, Passage

HORIZON = 4e-3
"""Cosine up to which a direction counts as one along the horizon."""
IN_PLANE = 1e-10
"""Cosine up to which points count as points of one plane, which see nothing of each other."""
_TURN = threading.Lock()
"""Lock of threads that launch kernels."""


@dataclass(frozen=True, eq=False)
class Starts:
    """Points of walls that scatter light.

    Attributes
    ----------
    at, normal : (S, 3) ndarray
        Positions in mm, and unit normals.
    isotropic, lambertian : (S,) ndarray
        Share of the incident light that each scatters with this law.
    """

    at: np.ndarray
    normal: np.ndarray
    isotropic: np.ndarray
    lambertian: np.ndarray


@dataclass(frozen=True, eq=False)
class LightRates:
    """Derivatives of the light on a surface, as components (N,): by its position (with opposite sign, by that of the
    start), by its area normal, by the unit normal at the start, and by a common translation of both relative to a
    box."""

    by_end: list[np.ndarray]
    by_area: list[np.ndarray]
    by_normal: list[np.ndarray]
    by_both: list[np.ndarray] | None = None


class Exchange:
    """Light from points of walls to points of a surface.

    Parameters
    ----------
    starts : Starts
        S points.
    at, area : (E, 3) ndarray
        Points of the surface, and its area normals.
    start, end : (N,) ndarray
        Numbers of start and end of each pair.
    box : Box or None
        Box between them.
    walls : (N,) ndarray or None
        Pairs between which it may stand, if not all: those without an end on the box.
    """

    def __init__(
        self,
        starts: Starts,
        at: np.ndarray,
        area: np.ndarray,
        start: np.ndarray,
        end: np.ndarray,
        box: Box | None = None,
        walls: np.ndarray | None = None,
    ) -> None:
        self._starts, self._ends = starts, (at, area)
        self._start, self._end, self._box, self._walls = start, end, box, walls

    def values(self, above: np.ndarray | None = None) -> np.ndarray:
        """(N,) light per unit of power and of the integration variables of the surface.

        Isotropic light ends at the horizon of its start, unless the share (N,) of the surface ``above`` it is given.
        """
        with _TURN:
            pair = self._pairs()
            value = pair.per_facing * pair.facing
            if above is not None:
                value = (pair.per_facing - pair.even + _floats(above) * pair.even_below) * pair.facing
            return np.array(value if self._box is None else value * self._passage(self._box).share)

    def leaving(self) -> np.ndarray:
        """(N,) mm, heights of the ends above the horizons of the starts."""
        with _TURN:
            return np.asarray(self._pairs().leaving)

    def part(self, pairs: np.ndarray) -> Exchange:
        """The light of some pairs, by their numbers."""
        walls = None if self._walls is None else self._walls[pairs]
        return Exchange(self._starts, *self._ends, self._start[pairs], self._end[pairs], self._box, walls)

    def in_plane(self) -> np.ndarray:
        """(N,) whether both ends of a pair lie in one plane, of which each sees the other as soon as it is bent."""
        with _TURN:
            pair = self._pairs()
            most = IN_PLANE * pair.distance
            return np.array((dr.abs(pair.leaving) <= most) & (dr.abs(pair.facing) <= most * dr.norm(pair.area)))

    def slopes(
        self,
        given: np.ndarray,
        wider: float = 1.0,
        above: np.ndarray | None = None,
        by_leaving: np.ndarray | None = None,
    ) -> LightRates:
        """Derivatives of the values, times ``given`` (N,), with a horizon that is ``wider`` by a factor; or of those
        with shares (N,) ``above`` it, which add ``by_leaving`` (N,) per mm of height above it."""
        with _TURN:
            pair, factor = self._pairs(), _floats(given)
            even, over, per_leaving = pair.even, pair.over, factor * pair.cosine * pair.facing
            if above is None or by_leaving is None:
                per_leaving += factor * pair.at_horizon(HORIZON * wider)
            else:
                even, over = _floats(above) * pair.even_below, dr.rcp(dr.square(pair.distance))
            per_facing = even + pair.cosine * pair.leaving
            radial = -(3 * even + 4 * pair.cosine * pair.leaving) * pair.facing * over
            by_end = factor * (radial * pair.d - per_facing * pair.area) + per_leaving * pair.normal
            found = [by_end, -factor * per_facing * pair.d, per_leaving * pair.d]
            if self._box is not None:
                passage = self._passage(self._box)
                of_end, of_both = (factor * per_facing * pair.facing * slope for slope in passage.slopes())
                found = [each * passage.share for each in found]
                found = [found[0] + of_end, *found[1:], of_both]
            if by_leaving is not None:
                found[0] += _floats(by_leaving) * pair.normal
                found[2] += _floats(by_leaving) * pair.d
            dr.eval(found)
            return LightRates(*([np.array(part) for part in each] for each in found))

    def _passage(self, box: Box) -> Passage:
        at, there = (
            _gathered(box.within(points), _numbers(numbers))
            for points, numbers in ((self._starts.at, self._start), (self._ends[0], self._end))
        )
        return Passage(box, at, there - at, True if self._walls is None else Bool(in_packets(self._walls, np.bool_)))

    def _pairs(self) -> _Pairs:
        start, end = _numbers(self._start), _numbers(self._end)
        at, normal = (_gathered(each, start) for each in (self._starts.at, self._starts.normal))
        even, lambertian = (
            dr.gather(Float64, _floats(each), start) for each in (self._starts.isotropic, self._starts.lambertian)
        )
        there, area = (_gathered(each, end) for each in self._ends)
        return _Pairs(there - at, normal, area, even, lambertian)


class _Pairs:
    """Vectors and factors of pairs, for values and derivatives."""

    def __init__(
        self, d: Array3f64, normal: Array3f64, area: Array3f64, isotropic: Float64, lambertian: Float64
    ) -> None:
        self.d, self.normal, self.area = d, normal, area
        squared = dr.dot(d, d)
        self.isotropic, self.distance = isotropic, dr.sqrt(squared)
        self.facing, self.leaving = -dr.dot(area, d), dr.dot(normal, d)
        seen = (self.facing > 0) & (self.leaving > IN_PLANE * self.distance)
        self.over = dr.select(seen, 1 / squared, 0)
        self.even = isotropic / (2 * math.pi) * self.over * dr.sqrt(self.over)
        self.cosine = lambertian / math.pi * self.over * self.over
        self.per_facing = self.even + self.cosine * self.leaving

    @property
    def even_below(self) -> Float64:
        """Isotropic light, as if it did not end at the horizon."""
        over = dr.select(self.facing > 0, dr.rcp(dr.square(self.distance)), 0)
        return self.isotropic / (2 * math.pi) * over * dr.sqrt(over)

    def at_horizon(self, width: float) -> Float64:
        """Loss of isotropic light in directions that pass below the horizon of the start, per mm of ``leaving``.

        Visibility is discontinuous there, and its derivative is spread over directions of a ``width`` (cosine). On a
        surface of uniform curvature, both ends see each other equally: the difference of their views is the
        contribution of the horizon.
        """
        over = dr.rcp(self.distance)
        cosine = self.leaving * over / width
        density = dr.select(dr.abs(cosine) < 1, 0.9375 / width * dr.square(1 - dr.square(cosine)), 0)
        facing = dr.maximum(self.facing - dr.norm(self.area) * self.leaving, 0)
        return self.isotropic / (2 * math.pi) * facing * density * dr.square(dr.square(over))


def _gathered(vectors: np.ndarray, numbers: UInt32) -> Array3f64:
    return dr.gather(Array3f64, Array3f64(*(_floats(each) for each in vectors.T)), numbers)


def _floats(values: np.ndarray) -> Float64:
    return Float64(in_packets(values, np.float64))


def _numbers(values: np.ndarray) -> UInt32:
    return UInt32(in_packets(values, np.uint32))
