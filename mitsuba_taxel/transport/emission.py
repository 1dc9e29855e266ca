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
"""Least distance from an LED's point to the middle of a piece, relative to its longest side, for laws that vary over a
radian; in proportion to the width of narrower ones."""
MOST_CUTS = 16
"""Most subdivisions of a patch: the spot of a cone of 0.05 degrees at 0.1 mm is wider than the smallest pieces."""
EDGE_CUTS = 2
"""Number of subdivisions of pieces that the edge of the cone crosses, before the edge is approximated by a parabola."""
MOST_EDGE_CUTS = 4
"""The same, where the edge leaves a piece by the side by which it entered."""
CLOSED, CLOSE = 1e-6, 0.01
"""Largest part of the power of an LED's point that leaves the walls if these receive all of it, and largest error of
the rules on pieces that is mended then."""
STEP = 1e-3
"""Movement in mm of the walls for the rate of the power within outlines, times the spread of narrow beams."""
RIM_POINTS = 4
"""Number of rays from a corner that the edge cuts off; each has one point less."""
EDGE_POINTS = 8
"""Number of points at the edge of a piece, for derivatives alone: where the edge is oblique to the rays, half of them
leave errors of 3 % in those of a narrow beam."""
TINY = np.finfo(float).tiny
_SIX = np.array([(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)])


@dataclass(frozen=True, eq=False)
class LitPoints:
    """Points lit by points of LEDs; ``edge`` are those at the edge of the cone.

    Attributes
    ----------
    source : (N,) ndarray
        Number of the LED's point.
    points : PatchPoints
        N of them.
    weight : (N,) ndarray
        In the integral over s and t; at the edge, lit area per change of the cosine.
    """

    source: np.ndarray
    points: PatchPoints
    weight: np.ndarray


@dataclass(frozen=True, eq=False)
class Emission:
    """Power of an LED on patches (F), whose values are known at Q points each."""

    led: End
    places: np.ndarray
    degree: int
    inside: LitPoints
    edge: LitPoints

    @cached_property
    def power(self) -> np.ndarray:
        """(F * Q,) shares of the LED's power for each of these points."""
        shares = self._shares(self.inside)
        size = shares.shape[1]
        into = self.inside.points.face[:, None] * size + np.arange(size)
        return np.bincount(into.ravel(), (self.lit[:, None] * shares).ravel(), len(self.places) * size)

    @cached_property
    def lit(self) -> np.ndarray:
        """(N,) shares of the LED's power for each of the points inside its cone."""
        return self._integrated * self._scale[self.inside.source]

    @cached_property
    def _integrated(self) -> np.ndarray:
        """(N,) the same by the rules on the pieces alone."""
        return _Rays(self.led, self.inside, self.places).value

    @cached_property
    def _of_source(self) -> np.ndarray:
        """(L,) shares of the LED's power from each of its points, by the rules on the pieces alone."""
        return np.bincount(self.inside.source, self._integrated, len(self.led.points))

    @cached_property
    def _scale(self) -> np.ndarray:
        """(L,) factors by which each point of an LED with a narrow beam emits its power if the walls receive all of it.

        Derivatives of the power through the position of the beam are differences of large numbers, which then cancel.
        """
        scale = np.ones(len(self.led.points))
        if self.led.law.spread < NARROW:
            whole = np.abs(self._within_outlines.sum(axis=1) - self.led.weights) < CLOSED * self.led.weights
            known = whole & (np.abs(self._of_source - self.led.weights) < CLOSE * self.led.weights)
            scale[known] = self.led.weights[known] / self._of_source[known]
        return scale

    @cached_property
    def _within_outlines(self) -> np.ndarray:
        """(L, F) shares of the LED's power from each of its points on each patch, by line integrals."""
        return self._outlined(self.places)

    def _outlined(self, places: np.ndarray) -> np.ndarray:
        share = power_within(self.led.points, self.led.normal, self.led.law.within, places)
        return self.led.weights[:, None] * share

    def outline_rate(self, velocity: np.ndarray) -> np.ndarray:
        """(F,) rate of the share of the LED's power within the outline of each patch, for patches that move along a
        velocity (F, 15, 3)."""
        fastest = np.abs(velocity).max(initial=0)
        if not fastest:
            return np.zeros(len(velocity))
        step = STEP * min(self.led.law.spread, 1.0) / fastest
        ahead, behind = (self._outlined(self.places + sign * step * velocity).sum(axis=0) for sign in (1, -1))
        return (ahead - behind) / (2 * step)

    @property
    def deviation(self) -> np.ndarray:
        """(F,) shares of the LED's power that the rules add on each patch to what passes through its outline."""
        on_patch = np.bincount(self.inside.points.face, self._integrated, len(self.places))
        return on_patch - self._within_outlines.sum(axis=0)

    def gradient(self, inside: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """(F, 15, 3) derivatives, by the patches' positions, of the integral of the power times values that are given
        at the points inside the cone and at its edge."""
        rays, rim = _Rays(self.led, self.inside, self.places), _Rays(self.led, self.edge, self.places)
        if (scaled := self._scale != 1).any():
            # d(sum v R / sum v) = sum dv (R - mean of R) / sum v
            mean = np.bincount(self.inside.source, self.lit * inside, len(self._scale)) / self.led.weights
            mean, scale = np.where(scaled, mean, 0), self._scale
            inside = scale[self.inside.source] * (inside - mean[self.inside.source])
            edge = scale[self.edge.source] * (edge - mean[self.edge.source])
        at, passed = inside[:, None], (edge * rim.value)[:, None]
        by_places = self.inside.points.gradient(self.places, at * rays.by_place, at * rays.by_area)
        return by_places + self.edge.points.gradient(self.places, passed * rim.of_cosine, np.zeros_like(rim.of_cosine))

    def _shares(self, lit: LitPoints) -> np.ndarray:
        return monomials(lit.points.at, self.degree) @ coefficients(self.degree)

    def at(self, lit: LitPoints, values: np.ndarray) -> np.ndarray:
        """(N,) ``values`` (F * Q,), interpolated at lit points."""
        shares = self._shares(lit)
        known = values.reshape(len(self.places), -1)[lit.points.face]
        return np.einsum("nq,nq->n", shares, known)


class _Rays:
    """Rays from points of an LED to the points that they light."""

    def __init__(self, led: End, lit: LitPoints, places: np.ndarray) -> None:
        self._led = led
        at, self.area = lit.points.placed(places)
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
        """(N, 3) derivative of the cosine by the lit point."""
        return (self._led.normal - self.cosine[:, None] * self.direction) / self.distance[:, None]

    @property
    def by_area(self) -> np.ndarray:
        lit = self.facing > 0
        return -(self.weight * self.intensity / self.squared * lit)[:, None] * self.direction

    @property
    def by_place(self) -> np.ndarray:
        """(N, 3) derivative of the value by the lit point."""
        per_square = (self.weight / self.squared)[:, None]
        lit = (self.facing > 0)[:, None]
        fall = (
            -(3 * (self.intensity * self.facing / self.distance)[:, None] * self.direction)
            - (self.intensity / self.distance)[:, None] * self.area
        )
        return per_square * lit * (fall + (self.slope * self.facing)[:, None] * self.of_cosine)


def emission(
    led: End, places: np.ndarray, rest: np.ndarray, degree: int, phototransistor: End | None = None
) -> Emission:
    """Power of ``led`` on patches with ``places`` (F, 15, 3), for the response of a ``phototransistor``.

    They are subdivided as needed at ``rest``, for sums that are smooth in the load, or at ``places`` if a law is
    peaked, as walls move along below the peak.
    """
    ends = [led] if phototransistor is None else [led, phototransistor]
    source, pieces = _lit_pieces(ends, places if any(end.law.is_peaked for end in ends) else rest)
    inside, edge = _clipped(led, places, source, pieces, degree)
    return Emission(led, places, degree, inside, edge)


def _lit_pieces(ends: Sequence[End], places: np.ndarray) -> tuple[np.ndarray, Pieces]:
    """Points of an LED (M,), each with a piece that it may light, as small as its distance and the law ask for, and
    the response of a phototransistor behind it in ``ends``.

    What lies wholly outside the law's spread is left out, so that the number of pieces depends neither on the width of
    the beam nor on the size of the patches.
    """
    led, *others = ends
    face, source = (numbers.ravel() for numbers in np.indices((len(places), len(led.points))))
    pieces = Pieces(face, np.broadcast_to(WHOLE, (len(face), 3, 2)))
    kept = []
    for cut in range(MOST_CUTS + 1):
        middle, size = pieces.extents(places)
        away = middle - led.points[source]
        distance = np.linalg.norm(away, axis=1)
        cosine = away @ led.normal / distance
        # A piece lies within a sphere round its middle with its longest side as radius.
        angular_radius = np.arcsin(np.minimum(size / distance, 1))
        lit = (np.arccos(np.clip(cosine, -1, 1)) - angular_radius < led.law.spread) | (size >= distance)
        near = distance < size * DISTANCE / np.minimum(led.law.width(cosine), 1.0)
        for end in others:
            near |= led.fineness * end.resolved(middle, size) < size
        ready = lit & ~near if cut < MOST_CUTS else lit
        kept.append((source[ready], pieces.face[ready], pieces.corners[ready]))
        further = lit & ~ready
        if not further.any():
            break
        source = np.repeat(source[further], 4)
        pieces = Pieces(np.repeat(pieces.face[further], 4), quartered(pieces.corners[further]))
    source, face, corners = (np.concatenate(part) for part in zip(*kept, strict=True))
    return source, Pieces(face, corners)


def _clipped(
    led: End, places: np.ndarray, source: np.ndarray, pieces: Pieces, degree: int
) -> tuple[LitPoints, LitPoints]:
    rule, weights = triangle_rule(degree)
    found, tipped = [], []
    for cut in range(MOST_EDGE_CUTS + 1):
        heights = _heights(led, places, source, pieces)
        corners, sides = heights[:, :3], heights[:, 3:]
        bend = np.abs(sides - (corners + np.roll(corners, -1, axis=1)) / 2).max(axis=1, initial=0)
        mixed = (heights.min(axis=1) - bend < 0) & (heights.max(axis=1) + bend > 0)
        up = (corners >= 0).sum(axis=1)
        tips = mixed & ((up == 1) | (up == 2)) if cut >= EDGE_CUTS else np.zeros_like(mixed)
        if cut == MOST_EDGE_CUTS:
            mixed = tips
        whole = (up == 3) & ~mixed | (up == 2) & tips
        kept = Pieces(pieces.face[whole], pieces.corners[whole])
        points = kept.points(rule).reshape(-1, 2)
        found.append((source[whole], kept.face, len(rule), points, np.outer(kept.areas(), weights).ravel()))
        tipped.append(tuple(each[tips] for each in (source, pieces.face, pieces.corners, heights)))
        left = mixed & ~tips
        source, face, corners = source[left], pieces.face[left], pieces.corners[left]
        source, pieces = np.repeat(source, 4), Pieces(np.repeat(face, 4), quartered(corners))
    source, face, corners, heights = (np.concatenate(each) for each in zip(*tipped, strict=True))
    tips, rims = _tips(corners, heights)
    found.append((source, face, *tips))
    return _lit(*zip(*found, strict=True)), _lit((source,), (face,), *((rim,) for rim in rims))


def _tips(corners: np.ndarray, heights: np.ndarray) -> tuple[tuple, tuple]:
    """Rules for pieces (M, 3, 2) with one lit corner and two dark ones, or vice versa.

    They cover the part between that corner, the tip, and the edge of the light, along rays from the tip, on which
    heights (M, 6) are quadratic. The part of a dark tip is subtracted from the whole piece.
    """
    up = heights[:, :3] >= 0
    lit_tip = up.sum(axis=1) == 1
    tip = np.argmax(up == lit_tip[:, None], axis=1)
    rows, turn = np.arange(len(tip))[:, None], (tip[:, None] + np.arange(3)) % 3
    corners, sign = corners[rows, turn], np.where(lit_tip, 1.0, -1.0)[:, None]
    (h0, h1, h2), (m01, m12, m20) = ((sign * heights[rows, k + turn]).T[:, :, None] for k in (0, 3))
    area = Pieces(rows[:, 0], corners).areas()[:, None]

    def cut_off(share: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rays (M, N, 2) from the tips, and the parts of them (M, N) up to the edge and passed per change of height."""
        # At ray `share` and distance r from the tip the height is h0 + slope r + bend r^2.
        a, b = 1 - share, share
        slope = a * (4 * m01 - 3 * h0 - h1) + b * (4 * m20 - 3 * h0 - h2)
        bend = 2 * (a**2 * (h0 + h1 - 2 * m01) + b**2 * (h0 + h2 - 2 * m20) + 2 * a * b * (h0 + m12 - m01 - m20))
        square = slope**2 - 4 * bend * h0
        root = np.where(square >= 0, np.sqrt(np.maximum(square, 0)) - slope, 0)
        ends_within = root > 2 * h0  # else the ray leaves the piece before the edge of the light
        reach = np.where(ends_within, 2 * h0 / np.where(ends_within, root, 1), 1)
        passed = np.where(ends_within, reach / np.maximum(np.abs(slope + 2 * bend * reach), TINY), 0)
        sides = corners[:, 1:] - corners[:, :1]
        return a[:, None] * sides[:, :1] + b[:, None] * sides[:, 1:], reach, passed

    (share, of_share), (along, of_along) = gauss(RIM_POINTS), gauss(RIM_POINTS - 1)
    rays, reach, _ = cut_off(share)
    points = corners[:, None, :1] + (reach[:, :, None] * along)[..., None] * rays[:, :, None]
    weights = (sign * area * of_share * reach**2)[:, :, None] * (of_along * along)
    share, of_share = gauss(EDGE_POINTS)
    rays, reach, passed = cut_off(share)
    ends = corners[:, :1] + reach[:, :, None] * rays
    return (
        (RIM_POINTS * (RIM_POINTS - 1), points.reshape(-1, 2), weights.ravel()),
        (EDGE_POINTS, ends.reshape(-1, 2), (area * of_share * passed).ravel()),
    )


def _lit(
    sources: Sequence[np.ndarray],
    faces: Sequence[np.ndarray],
    sizes: Sequence[int],
    points: Sequence[np.ndarray],
    weights: Sequence[np.ndarray],
) -> LitPoints:
    """All points of pieces with numbers ``sizes`` of points, in the order of the patches."""
    source, face = (
        np.concatenate([np.repeat(each, size) for each, size in zip(rows, sizes, strict=True)])
        for rows in (sources, faces)
    )
    order = np.argsort(face, kind="stable")
    return LitPoints(
        source[order], PatchPoints(face[order], np.concatenate(points)[order]), np.concatenate(weights)[order]
    )


def _heights(led: End, places: np.ndarray, source: np.ndarray, pieces: Pieces) -> np.ndarray:
    """(M, 6) cosine at corners and midpoints of sides of pieces, minus that at the edge of the cone."""
    order = np.argsort(pieces.face, kind="stable")
    points = PatchPoints(np.repeat(pieces.face[order], 6), pieces.points(_SIX)[order].reshape(-1, 2))
    at = np.empty((len(order), 6, 3))
    at[order] = points.places(places).reshape(-1, 6, 3)
    away = at - led.points[source][:, None]
    return (away @ led.normal) / np.linalg.norm(away, axis=2) - led.law.cutoff
