"""Light exchange between diffuse walls: from a point of a wall to a surface.

All integrals are over surfaces. Let d be the vector from a point x to a point y of a surface, r = |d|, n the unit
normal at x, and N the area normal at y, whose length is the area per unit of the integration variables. Light that x
scatters isotropically arrives at y with the density -(N . d) / (2 pi r^3), light that it scatters by Lambert's law with
(n . d) (-N . d) / (pi r^4).
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
"""Cosine of the angle to the normal up to which a direction counts as along the horizon."""
IN_PLANE = 1e-10
"""Cosine up to which two points count as points of one plane; such points do not see each other."""
_TURN = threading.Lock()
"""Lock with which one thread at a time launches kernels."""


@dataclass(frozen=True, eq=False)
class Starts:
    """S points of walls from which scattered light starts.

    Attributes
    ----------
    at, normal : (S, 3) ndarray
        Positions in mm, and unit normals.
    isotropic, lambertian : (S,) ndarray
        Fraction of the incident light that each point scatters by the law of this name.
    """

    at: np.ndarray
    normal: np.ndarray
    isotropic: np.ndarray
    lambertian: np.ndarray

    def block(self, rows: slice) -> Starts:
        """The starting points with the numbers ``rows`` only."""
        return Starts(self.at[rows], self.normal[rows], self.isotropic[rows], self.lambertian[rows])


@dataclass(frozen=True, eq=False)
class LightRates:
    """Derivatives of the light exchanged by N pairs of points; each is a vector, given as its components (N,).

    Attributes
    ----------
    by_end : list of (N,) ndarray
        Derivatives with respect to the position of the end, per mm. The derivative with respect to the position of the
        start has the opposite sign.
    by_area : list of (N,) ndarray
        Derivatives with respect to the area normal of the end.
    by_normal : list of (N,) ndarray
        Derivatives with respect to the unit normal of the start.
    by_both : list of (N,) ndarray or None
        Derivatives with respect to a common translation of both ends relative to a box, per mm; None without a box.
    """

    by_end: list[np.ndarray]
    by_area: list[np.ndarray]
    by_normal: list[np.ndarray]
    by_both: list[np.ndarray] | None = None


class Exchange:
    """Light that N pairs of points exchange, from points of walls to points of a surface.

    Parameters
    ----------
    starts : Starts
        Points of walls where the light starts; S is their number.
    at, area : (E, 3) ndarray
        E points of the surface, and its area normals.
    start, end : (N,) ndarray
        Numbers of start and end of each pair.
    box : Box or None
        Box that blocks light between them.
    can_block : (N,) ndarray of bool or None
        Pairs that the box may block: those without an end on it. None for all pairs.
    """

    def __init__(
        self,
        starts: Starts,
        at: np.ndarray,
        area: np.ndarray,
        start: np.ndarray,
        end: np.ndarray,
        box: Box | None = None,
        can_block: np.ndarray | None = None,
    ) -> None:
        self._starts, self._ends = starts, (at, area)
        self._start, self._end, self._box, self._can_block = start, end, box, can_block

    def values(self, above: np.ndarray | None = None) -> np.ndarray:
        """Light that arrives at the end of each of the N pairs, per unit of power at its start.

        Parameters
        ----------
        above : (N,) ndarray or None
            Fraction of the surface at the end of each pair that lies above the horizon, the tangent plane at the start.
            Isotropic light is multiplied by it. None: isotropic light is 0 at points below the horizon.

        Returns
        -------
        (N,) ndarray
            Light per unit of the integration variables of the surface.
        """
        with _TURN:
            pair = self._pairs()
            value = pair.per_facing * pair.facing
            if above is not None:
                value = (pair.per_facing - pair.even + _floats(above) * pair.even_below) * pair.facing
            return np.array(value if self._box is None else value * self._passage(self._box).fraction)

    def leaving(self) -> np.ndarray:
        """Heights (N,) in mm of the end points above the tangent planes (horizons) of the starting points."""
        with _TURN:
            return np.asarray(self._pairs().leaving)

    def subset(self, pairs: np.ndarray) -> Exchange:
        """The light between selected pairs of points only, given by their numbers."""
        can_block = None if self._can_block is None else self._can_block[pairs]
        return Exchange(self._starts, *self._ends, self._start[pairs], self._end[pairs], self._box, can_block)

    def in_plane(self) -> np.ndarray:
        """Mask (N,) of the pairs whose ends lie in one plane; they would see each other if this plane bent inwards."""
        with _TURN:
            pair = self._pairs()
            most = IN_PLANE * pair.distance
            return np.array((dr.abs(pair.leaving) <= most) & (dr.abs(pair.facing) <= most * dr.norm(pair.area)))

    def slopes(
        self,
        weight: np.ndarray,
        wider: float = 1.0,
        above: np.ndarray | None = None,
        by_leaving: np.ndarray | None = None,
    ) -> LightRates:
        """Derivatives of the exchanged light with respect to the positions and normals of both points, times a weight.

        Parameters
        ----------
        weight : (N,) ndarray
            Weight of each pair.
        wider : float
            Factor of the width :data:`HORIZON` over which the step at the horizon is smoothed.
        above : (N,) ndarray or None
            Fraction of the surface at the end of each pair that lies above the horizon of the start; see
            :meth:`values`.
        by_leaving : (N,) ndarray or None
            Needed with ``above``, which depends on the heights of the ends above the horizons: derivatives of the
            weighted values with respect to these heights, per mm.

        Returns
        -------
        LightRates
            Derivatives for each pair.
        """
        with _TURN:
            pair, factor = self._pairs(), _floats(weight)
            # Light falls with the distance and the cosines; its step at the horizon is smoothed, or contained in
            # ``by_leaving``.
            even, over, per_leaving = pair.even, pair.over, factor * pair.cosine * pair.facing
            if above is None or by_leaving is None:
                per_leaving += factor * pair.at_horizon(HORIZON * wider)
            else:
                even, over = _floats(above) * pair.even_below, dr.rcp(dr.square(pair.distance))
            per_facing = even + pair.cosine * pair.leaving
            radial = -(3 * even + 4 * pair.cosine * pair.leaving) * pair.facing * over
            by_end = factor * (radial * pair.d - per_facing * pair.area) + per_leaving * pair.normal
            rates = [by_end, -factor * per_facing * pair.d, per_leaving * pair.d]
            # A box lets a fraction of the light pass, which depends on both ends.
            if self._box is not None:
                passage = self._passage(self._box)
                of_end, of_both = (factor * per_facing * pair.facing * slope for slope in passage.slopes())
                rates = [rate * passage.fraction for rate in rates]
                rates = [rates[0] + of_end, *rates[1:], of_both]
            if by_leaving is not None:
                rates[0] += _floats(by_leaving) * pair.normal
                rates[2] += _floats(by_leaving) * pair.d
            dr.eval(rates)
            return LightRates(*([np.array(component) for component in rate] for rate in rates))

    def _passage(self, box: Box) -> Passage:
        start, end = (
            _gathered(box.to_box(points), _numbers(numbers))
            for points, numbers in ((self._starts.at, self._start), (self._ends[0], self._end))
        )
        can_block = True if self._can_block is None else Bool(in_packets(self._can_block, np.bool_))
        return Passage(box, start, end - start, can_block)

    def _pairs(self) -> _Pairs:
        start, end = _numbers(self._start), _numbers(self._end)
        at, normal = (_gathered(vectors, start) for vectors in (self._starts.at, self._starts.normal))
        isotropic, lambertian = (
            dr.gather(Float64, _floats(fraction), start)
            for fraction in (self._starts.isotropic, self._starts.lambertian)
        )
        end_at, area = (_gathered(vectors, end) for vectors in self._ends)
        return _Pairs(end_at - at, normal, area, isotropic, lambertian)


class _Pairs:
    """Vectors and factors of pairs of points, for values and derivatives.

    ``facing`` is -(N . d), ``leaving`` is (n . d), the height of the end above the horizon of the start; ``even`` and
    ``cosine`` are the factors of isotropic and of Lambertian light, 0 where the ends do not see each other.
    """

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
        """Factor of isotropic light as if it did not end at the horizon: light from points below the horizon counts as
        well.
        """
        over = dr.select(self.facing > 0, dr.rcp(dr.square(self.distance)), 0)
        return self.isotropic / (2 * math.pi) * over * dr.sqrt(over)

    def at_horizon(self, width: float) -> Float64:
        """Gain of isotropic light per mm when the end point of a pair rises above the horizon (the tangent plane) of
        its start.

        Light appears there at once; its derivative is smoothed over directions within a ``width`` (cosine). On a
        surface of uniform curvature both points rise above each other's horizon together, so only the difference of
        ``facing`` and ``leaving`` counts.
        """
        over = dr.rcp(self.distance)
        cosine = self.leaving * over / width
        density = dr.select(dr.abs(cosine) < 1, 0.9375 / width * dr.square(1 - dr.square(cosine)), 0)
        facing = dr.maximum(self.facing - dr.norm(self.area) * self.leaving, 0)
        return self.isotropic / (2 * math.pi) * facing * density * dr.square(dr.square(over))


def _gathered(vectors: np.ndarray, numbers: UInt32) -> Array3f64:
    return dr.gather(Array3f64, Array3f64(*(_floats(component) for component in vectors.T)), numbers)


def _floats(values: np.ndarray) -> Float64:
    return Float64(in_packets(values, np.float64))


def _numbers(values: np.ndarray) -> UInt32:
    return UInt32(in_packets(values, np.uint32))
