"""Power of an LED on patches: the integral of its intensity over them, clipped at the edge of its cone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.transport.ends import End
from mitsuba_taxel.transport.patches import PatchPoints
from mitsuba_taxel.transport.pieces import Pieces, cut_near, quartered
from mitsuba_taxel.transport.rules import coefficients, gauss, monomials, triangle_rule

DISTANCE = 1.5
"""As for :func:`cut_near`, for laws that vary over a radian."""
EDGE_CUTS = 2
"""Number of subdivisions of pieces that the edge of the cone crosses, before the edge is approximated by a parabola."""
MOST_EDGE_CUTS = 4
"""The same, where the edge leaves a piece by the side by which it entered."""
RIM_POINTS = 3
"""Number of rays from a corner that the edge cuts off; each has one point less."""
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
        return _Rays(self.led, self.inside, self.places).value

    def gradient(self, inside: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """(F, 15, 3) derivatives, by the patches' positions, of the integral of the power times values that are given
        at the points inside the cone and at its edge."""
        rays, rim = _Rays(self.led, self.inside, self.places), _Rays(self.led, self.edge, self.places)
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


def emission(led: End, places: np.ndarray, rest: np.ndarray, degree: int) -> Emission:
    """Power of ``led`` on patches with ``places`` (F, 15, 3).

    They are subdivided as needed at ``rest``, for sums that are smooth in the load, or at ``places`` if the law is
    peaked, as walls move along below the peak.
    """
    sources, faces, corners = [], [], []

    def distance(away: np.ndarray) -> np.ndarray:
        cosines = away @ led.normal / np.linalg.norm(away, axis=1)
        return DISTANCE / np.minimum(led.law.width(cosines), 1.0)

    for source, which, pieces in cut_near(led.points, places if led.law.is_peaked else rest, None, distance):
        sources.append(source)
        faces.append(pieces.face[which])
        corners.append(pieces.corners[which])
    source, pieces = np.concatenate(sources), Pieces(np.concatenate(faces), np.concatenate(corners))
    inside, edge = _clipped(led, places, source, pieces, degree)
    return Emission(led, places, degree, inside, edge)


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
    return _lit(*zip(*found, strict=True)), _lit((source,), (face,), *((each,) for each in rims))


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
    (share, of_share), (along, of_along) = gauss(RIM_POINTS), gauss(RIM_POINTS - 1)
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
    rays = a[:, None] * sides[:, :1] + b[:, None] * sides[:, 1:]
    area = Pieces(rows[:, 0], corners).areas()[:, None]
    ends = corners[:, :1] + reach[:, :, None] * rays
    points = corners[:, None, :1] + (reach[:, :, None] * along)[..., None] * rays[:, :, None]
    weights = (sign * area * of_share * reach**2)[:, :, None] * (of_along * along)
    size = len(share) * len(along)
    return (
        (size, points.reshape(-1, 2), weights.ravel()),
        (len(share), ends.reshape(-1, 2), (area * of_share * passed).ravel()),
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
