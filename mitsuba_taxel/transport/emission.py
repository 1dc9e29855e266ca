"""Power of an LED on patches: the integral of its intensity over them, clipped at the edge of its cone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.transport.laws.ends import NARROW, End
from mitsuba_taxel.transport.outline import power_within
from mitsuba_taxel.transport.patches import PatchPoints
from mitsuba_taxel.transport.pieces import WHOLE, Pieces, quartered
from mitsuba_taxel.transport.rules import coefficients, gauss, monomials, triangle_rule

DISTANCE = 1.5
"""Smallest distance from a point of an LED to the middle of a piece, relative to the longest side of the piece, for
laws that vary over a radian; it is divided by the width of narrower laws."""
MOST_CUTS = 16
"""Largest number of subdivisions of a patch: the spot of a cone of 0.05 degrees at 0.1 mm is wider than the smallest
pieces."""
EDGE_CUTS = 2
"""Number of subdivisions of pieces that the edge of the cone crosses, before the edge is approximated by a parabola."""
MOST_EDGE_CUTS = 4
"""The same for pieces that the edge of the cone enters and leaves through the same side."""
CLOSED, CLOSE = 1e-6, 0.01
"""Walls are closed around a point of an LED if at most this fraction of its power misses them; largest relative error
of the rules on pieces that is then corrected."""
CHECKED = 4
"""Every fourth point of an LED with a wide beam is checked against the power within outlines, as all points emit
alike."""
STEP = 1e-3
"""Displacement of the walls in mm for finite differences of the power within outlines; for narrow beams, multiplied by
their spread."""
RIM_POINTS = 4
"""Number of rays from a corner that the edge of the cone cuts off; each ray has one point less than there are rays."""
EDGE_POINTS = 8
"""Number of points at the edge within a piece, for derivatives only. With half of them, derivatives of a narrow beam
are wrong by 3 % where the edge is oblique to the rays."""
TINY = np.finfo(float).tiny
_SIX = np.array([(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)])


@dataclass(frozen=True, eq=False)
class LitPoints:
    """N points of patches that are lit by points of an LED.

    Attributes
    ----------
    source : (N,) ndarray
        Number of the LED's point from which the light comes.
    points : PatchPoints
        The N lit points.
    weight : (N,) ndarray
        Weight in the integral over s and t. At the edge of the cone: lit area per change of the cosine.
    """

    source: np.ndarray
    points: PatchPoints
    weight: np.ndarray


@dataclass(frozen=True, eq=False)
class Emission:
    """Power that an LED sends onto patches of the walls.

    Attributes
    ----------
    led : End
        Points and law of the LED.
    positions : (F, 15, 3) ndarray
        Positions of the 15 points of each of F patches, in mm.
    degree : int
        Degree of the polynomials that interpolate values on each patch from its Q points.
    inside, edge : LitPoints
        Lit points within the cone of the LED, and at its edge.
    """

    led: End
    positions: np.ndarray
    degree: int
    inside: LitPoints
    edge: LitPoints

    @cached_property
    def power(self) -> np.ndarray:
        """Fractions (F * Q,) of the LED's power at the Q points of each of F patches. Sums over the points are
        integrals.
        """
        weights = self._interpolation(self.inside)
        size = weights.shape[1]
        point = self.inside.points.face[:, None] * size + np.arange(size)
        return np.bincount(point.ravel(), (self.lit[:, None] * weights).ravel(), len(self.positions) * size)

    @cached_property
    def lit(self) -> np.ndarray:
        """Fractions (N,) of the LED's power at the N lit points inside its cone. They are scaled such that closed walls
        receive exactly the power of the LED.
        """
        return self._integrated * self._scale[self.inside.source]

    @cached_property
    def _integrated(self) -> np.ndarray:
        """Fractions (N,) of the LED's power at the points inside its cone, by quadrature alone."""
        return _Rays(self.led, self.inside, self.positions).value

    @cached_property
    def _scale(self) -> np.ndarray:
        """Factors (L,) by which the light of each of L points of the LED is multiplied, so that closed walls receive
        exactly its power.

        They differ from 1 for narrow beams only. Derivatives with respect to the position of such a beam are
        differences of large numbers, which cancel exactly with these factors.
        """
        scale, weights = np.ones(len(self.led.points)), self.led.weights
        if self._is_narrow:
            by_rules = np.bincount(self.inside.source, self._integrated, len(self.led.points))
            closed = np.abs(self._within_outlines.sum(axis=1) - weights) < CLOSED * weights
            corrected = closed & (np.abs(by_rules - weights) < CLOSE * weights)
            scale[corrected] = weights[corrected] / by_rules[corrected]
        return scale

    @cached_property
    def _within_outlines(self) -> np.ndarray:
        """Fractions (L, F) of the LED's power from each of its points on each patch, by line integrals."""
        return self._outlined(self.positions)

    def _outlined(self, positions: np.ndarray, sources: slice | np.ndarray = slice(None)) -> np.ndarray:
        fraction = power_within(self.led.points[sources], self.led.normal, self.led.law.within, positions)
        return self.led.weights[sources, None] * fraction

    @property
    def _is_narrow(self) -> bool:
        return self.led.law.spread < NARROW

    def outline_rate(self, velocity: np.ndarray) -> np.ndarray:
        """Derivative (F,) of the fraction of the LED's power within the outline of each patch with respect to a
        parameter.

        The patches move by ``velocity`` (F, 15, 3) in mm per unit of the parameter; the derivative is a finite
        difference.
        """
        fastest = np.abs(velocity).max(initial=0)
        if not fastest:
            return np.zeros(len(velocity))
        step = STEP * min(self.led.law.spread, 1.0) / fastest
        ahead, behind = (self._outlined(self.positions + sign * step * velocity).sum(axis=0) for sign in (1, -1))
        return (ahead - behind) / (2 * step)

    @cached_property
    def deviation(self) -> np.ndarray:
        """Quadrature error of the LED's power on each patch (F,): the power by the quadrature minus that within its
        outline, as a fraction of the LED's power.
        """
        if self._is_narrow:
            on_patch = np.bincount(self.inside.points.face, self._integrated, len(self.positions))
            return on_patch - self._within_outlines.sum(axis=0)
        # Neighbouring points of a wide beam see the same pieces.
        sources = np.arange(len(self.led.points))[::CHECKED]
        is_checked = np.isin(self.inside.source, sources)
        face, power = self.inside.points.face[is_checked], self._integrated[is_checked]
        on_patch = np.bincount(face, power, len(self.positions))
        within = self._outlined(self.positions, sources).sum(axis=0)
        return (on_patch - within) * self.led.weights.sum() / self.led.weights[sources].sum()

    def gradient(self, inside: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """Derivatives with respect to the positions of the patches, of the integral of the power times a function.

        Parameters
        ----------
        inside : (N,) ndarray
            Values of the function at the points inside the cone.
        edge : (M,) ndarray
            Values of the function at the points of the edge.

        Returns
        -------
        (F, 15, 3) ndarray
            Derivatives per mm.
        """
        rays, rim = _Rays(self.led, self.inside, self.positions), _Rays(self.led, self.edge, self.positions)
        # With the light v of a scaled source and the function R, d(sum v R / sum v) = sum dv (R - mean of R) / sum v.
        if (scaled := self._scale != 1).any():
            mean = np.bincount(self.inside.source, self.lit * inside, len(self._scale)) / self.led.weights
            mean, scale = np.where(scaled, mean, 0), self._scale
            inside = scale[self.inside.source] * (inside - mean[self.inside.source])
            edge = scale[self.edge.source] * (edge - mean[self.edge.source])
        # Inside, the light on each point changes; at the edge, points enter or leave the cone.
        inside, entering = inside[:, None], (edge * rim.value)[:, None]
        by_inside = self.inside.points.gradient(self.positions, inside * rays.by_position, inside * rays.by_area)
        zero = np.zeros_like(rim.of_cosine)
        return by_inside + self.edge.points.gradient(self.positions, entering * rim.of_cosine, zero)

    def _interpolation(self, lit: LitPoints) -> np.ndarray:
        """Weights (N, Q) with which values at the Q points of a patch are interpolated at N lit points."""
        return monomials(lit.points.at, self.degree) @ coefficients(self.degree)

    def at(self, lit: LitPoints, values: np.ndarray) -> np.ndarray:
        """Interpolate values, which are given on the patches, at lit points.

        Parameters
        ----------
        lit : LitPoints
            N lit points.
        values : (F * Q,) ndarray
            Values at the points of the patches.

        Returns
        -------
        (N,) ndarray
            Interpolated values.
        """
        of_patch = values.reshape(len(self.positions), -1)[lit.points.face]
        return np.einsum("nq,nq->n", self._interpolation(lit), of_patch)


class _Rays:
    """N rays from points of an LED to the points that they light. The ``value`` of a ray is the fraction of the LED's
    power that it carries.
    """

    def __init__(self, led: End, lit: LitPoints, positions: np.ndarray) -> None:
        self._led = led
        at, self.area = lit.points.positions_and_areas(positions)
        away = at - led.points[lit.source]
        self.squared = (away**2).sum(axis=1)
        self.distance = np.sqrt(self.squared)
        self.direction = away / self.distance[:, None]
        self.cosine = self.direction @ led.normal
        self.facing = np.maximum(-(self.area * self.direction).sum(axis=1), 0)
        self.intensity, self.slope = led.law(self.cosine)
        self.weight = lit.weight * led.weights[lit.source]
        self.value = self.weight * self.intensity * self.facing / self.squared

    @property
    def of_cosine(self) -> np.ndarray:
        """Derivative (N, 3) of the cosine between the ray and the LED's axis with respect to the lit point."""
        return (self._led.normal - self.cosine[:, None] * self.direction) / self.distance[:, None]

    @property
    def by_area(self) -> np.ndarray:
        """Derivative (N, 3) of each ray's value with respect to the area normal of the lit point."""
        lit = self.facing > 0
        return -(self.weight * self.intensity / self.squared * lit)[:, None] * self.direction

    @property
    def by_position(self) -> np.ndarray:
        """Derivative (N, 3) of each ray's value with respect to the lit point."""
        per_square = (self.weight / self.squared)[:, None]
        lit = (self.facing > 0)[:, None]
        fall = (
            -(3 * (self.intensity * self.facing / self.distance)[:, None] * self.direction)
            - (self.intensity / self.distance)[:, None] * self.area
        )
        return per_square * lit * (fall + (self.slope * self.facing)[:, None] * self.of_cosine)


def emission(
    led: End, positions: np.ndarray, rest: np.ndarray, degree: int, phototransistor: End | None = None
) -> Emission:
    """Power of an LED on patches.

    Patches are subdivided by their undeformed positions, so that sums are smooth in the load. If the law of LED or
    phototransistor is peaked, they are subdivided by their deformed positions, as the walls move sideways below the
    peak.

    Parameters
    ----------
    led : End
        Points and law of the LED.
    positions, rest : (F, 15, 3) ndarray
        Deformed and undeformed positions of the patches, in mm.
    degree : int
        Degree of the polynomials that interpolate values on each patch.
    phototransistor : End, optional
        Phototransistor whose response the pieces must resolve as well.

    Returns
    -------
    Emission
        Emission at the deformed positions.
    """
    peaked = any(end.law.is_peaked for end in (led, phototransistor) if end is not None)
    source, pieces = _lit_pieces(led, phototransistor, positions if peaked else rest)
    inside, edge = _clipped(led, positions, source, pieces, degree)
    return Emission(led, positions, degree, inside, edge)


def _lit_pieces(led: End, phototransistor: End | None, positions: np.ndarray) -> tuple[np.ndarray, Pieces]:
    """M pairs of a point of an LED and a piece of a patch that it may light: the numbers (M,) of the points, and the
    pieces.

    The pieces are as small as their distance, the law of the LED and the response of the phototransistor require. Those
    outside the law's spread are left out, so that the number of pieces depends neither on the width of the beam nor on
    the size of the patches.
    """
    face, source = (numbers.ravel() for numbers in np.indices((len(positions), len(led.points))))
    pieces = Pieces(face, np.broadcast_to(WHOLE, (len(face), 3, 2)))
    kept = []
    for cut in range(MOST_CUTS + 1):
        middle, size = pieces.extents(positions)
        away = middle - led.points[source]
        distance = np.linalg.norm(away, axis=1)
        cosine = away @ led.normal / distance
        # A piece lies within a sphere round its middle with its longest side as radius.
        angular_radius = np.arcsin(np.minimum(size / distance, 1))
        lit = (np.arccos(np.clip(cosine, -1, 1)) - angular_radius < led.law.spread) | (size >= distance)
        coarse = distance < size * DISTANCE / np.minimum(led.law.width(cosine), 1.0)
        if phototransistor is not None:
            coarse |= led.fineness * phototransistor.resolved(middle, size) < size
        ready = lit & ~coarse if cut < MOST_CUTS else lit
        kept.append((source[ready], pieces.face[ready], pieces.corners[ready]))
        divided = lit & ~ready
        if not divided.any():
            break
        source = np.repeat(source[divided], 4)
        pieces = Pieces(np.repeat(pieces.face[divided], 4), quartered(pieces.corners[divided]))
    source, face, corners = (np.concatenate(column) for column in zip(*kept, strict=True))
    return source, Pieces(face, corners)


def _clipped(
    led: End, positions: np.ndarray, source: np.ndarray, pieces: Pieces, degree: int
) -> tuple[LitPoints, LitPoints]:
    """Clip pieces of patches at the edge of an LED's cone. Returns quadrature points on the lit area, and quadrature
    points along the edge of the cone within the pieces.

    Pieces that the edge crosses are subdivided, until the edge cuts off one of their corners.
    """
    rule, weights = triangle_rule(degree)
    inside, tipped = [], []
    for cut in range(MOST_EDGE_CUTS + 1):
        # Cosine at corners and midpoints of sides, minus that at the edge of the cone: the "height" above the edge.
        order = np.argsort(pieces.face, kind="stable")
        points = PatchPoints(np.repeat(pieces.face[order], 6), pieces.points(_SIX)[order].reshape(-1, 2))
        at = np.empty((len(order), 6, 3))
        at[order] = points.interpolated(positions).reshape(-1, 6, 3)
        away = at - led.points[source][:, None]
        heights = (away @ led.normal) / np.linalg.norm(away, axis=2) - led.law.cutoff
        # A piece is crossed by the edge if heights, which bend between the corners, may have both signs.
        corners, sides = heights[:, :3], heights[:, 3:]
        bend = np.abs(sides - (corners + np.roll(corners, -1, axis=1)) / 2).max(axis=1, initial=0)
        mixed = (heights.min(axis=1) - bend < 0) & (heights.max(axis=1) + bend > 0)
        up = (corners >= 0).sum(axis=1)
        tips = mixed & ((up == 1) | (up == 2)) if cut >= EDGE_CUTS else np.zeros_like(mixed)
        if cut == MOST_EDGE_CUTS:
            mixed = tips
        # Entire pieces, of which dark corners are subtracted below; pieces whose corner is cut off; those to subdivide.
        entire = (up == 3) & ~mixed | (up == 2) & tips
        kept = Pieces(pieces.face[entire], pieces.corners[entire])
        at_rule = kept.points(rule).reshape(-1, 2)
        inside.append((source[entire], kept.face, len(rule), at_rule, np.outer(kept.areas(), weights).ravel()))
        tipped.append(tuple(values[tips] for values in (source, pieces.face, pieces.corners, heights)))
        divided = mixed & ~tips
        source = np.repeat(source[divided], 4)
        pieces = Pieces(np.repeat(pieces.face[divided], 4), quartered(pieces.corners[divided]))
    source, face, corners, heights = (np.concatenate(column) for column in zip(*tipped, strict=True))
    in_tips, at_edge = _tips(corners, heights)
    inside.append((source, face, *in_tips))
    return _lit(*zip(*inside, strict=True)), _lit((source,), (face,), *((values,) for values in at_edge))


def _tips(corners: np.ndarray, heights: np.ndarray) -> tuple[tuple, tuple]:
    """Quadrature rules for pieces (M, 3, 2) that the edge of the LED's cone crosses, so that one corner is lit and two
    are dark, or vice versa.

    The single corner is called the tip. The points cover the area between the tip and the edge of the light, along rays
    from the tip; heights (M, 6) are quadratic along these rays. The area of a dark tip is subtracted from the entire
    piece. Returns the number of points per piece, and two groups of points and weights: in the light, and at its edge.
    """
    # Corners and heights in the order that begins with the tip; heights have the sign of the tip.
    up = heights[:, :3] >= 0
    lit_tip = up.sum(axis=1) == 1
    tip = np.argmax(up == lit_tip[:, None], axis=1)
    rows, turn = np.arange(len(tip))[:, None], (tip[:, None] + np.arange(3)) % 3
    corners, sign = corners[rows, turn], np.where(lit_tip, 1.0, -1.0)[:, None]
    (h0, h1, h2), (m01, m12, m20) = ((sign * heights[rows, k + turn]).T[:, :, None] for k in (0, 3))
    area = Pieces(rows[:, 0], corners).areas()[:, None]

    def cut_off(node: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rays across M triangles, from one corner of each to N points (nodes) of the opposite side, at the edge of the
        light's cone.

        Returns the rays (M, N, 2), the fractions (M, N) of the rays up to the edge, and the change of the fractions per
        change of height.
        """
        # At the fraction r of a ray, the height is h0 + slope r + bend r^2.
        a, b = 1 - node, node
        slope = a * (4 * m01 - 3 * h0 - h1) + b * (4 * m20 - 3 * h0 - h2)
        bend = 2 * (a**2 * (h0 + h1 - 2 * m01) + b**2 * (h0 + h2 - 2 * m20) + 2 * a * b * (h0 + m12 - m01 - m20))
        square = slope**2 - 4 * bend * h0
        root = np.where(square >= 0, np.sqrt(np.maximum(square, 0)) - slope, 0)
        ends_within = root > 2 * h0  # else the ray leaves the piece before the edge of the light
        reach = np.where(ends_within, 2 * h0 / np.where(ends_within, root, 1), 1)
        rate = np.where(ends_within, reach / np.maximum(np.abs(slope + 2 * bend * reach), TINY), 0)
        sides = corners[:, 1:] - corners[:, :1]
        return a[:, None] * sides[:, :1] + b[:, None] * sides[:, 1:], reach, rate

    # Inside: Gauss' rule over the rays and along each of them.
    (across, of_across), (along, of_along) = gauss(RIM_POINTS), gauss(RIM_POINTS - 1)
    rays, reach, _ = cut_off(across)
    points = corners[:, None, :1] + (reach[:, :, None] * along)[..., None] * rays[:, :, None]
    weights = (sign * area * of_across * reach**2)[:, :, None] * (of_along * along)
    # At the edge: the ends of more rays.
    across, of_across = gauss(EDGE_POINTS)
    rays, reach, rate = cut_off(across)
    ends = corners[:, :1] + reach[:, :, None] * rays
    return (
        (RIM_POINTS * (RIM_POINTS - 1), points.reshape(-1, 2), weights.ravel()),
        (EDGE_POINTS, ends.reshape(-1, 2), (area * of_across * rate).ravel()),
    )


def _lit(
    sources: Sequence[np.ndarray],
    faces: Sequence[np.ndarray],
    sizes: Sequence[int],
    points: Sequence[np.ndarray],
    weights: Sequence[np.ndarray],
) -> LitPoints:
    """Join the lit points of several groups of pieces, in the order of the patches. ``sizes`` states the number of
    points of each piece of a group."""
    source, face = (
        np.concatenate([np.repeat(numbers, size) for numbers, size in zip(groups, sizes, strict=True)])
        for groups in (sources, faces)
    )
    order = np.argsort(face, kind="stable")
    return LitPoints(
        source[order], PatchPoints(face[order], np.concatenate(points)[order]), np.concatenate(weights)[order]
    )
