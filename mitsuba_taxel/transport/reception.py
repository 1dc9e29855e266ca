"""Response of a phototransistor to light scattered by walls."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from mitsuba_taxel.transport.exchange import Exchange, Starts
from mitsuba_taxel.transport.laws.ends import AngularLaw, CosineFactor, End
from mitsuba_taxel.transport.outline import TOLERANCE, Cumulative, power_within
from mitsuba_taxel.transport.patches import PatchPoints
from mitsuba_taxel.transport.rules import gauss, triangle_rule

CHECKED, ANGLES = 7, 1024
"""Every seventh point of a phototransistor is checked; number of intervals of the angle for the integral of its
response."""
PAIRS_AT_ONCE = 1 << 20
"""Largest number of pairs of points of walls and phototransistor in memory at once; a pair takes some 200 bytes."""
WIDER = 10.0
"""Width over which the step at the horizon of a wall is smoothed, relative to that between walls. It is the spacing of
the points of a phototransistor as seen from a wall nearby, whose horizon passes entire rows of them at once."""


class Reception:
    """Response of a phototransistor to light scattered directly towards it by T points of walls.

    Pairs of points of walls and phototransistor are computed in blocks, and not kept: a narrow response needs
    tens of millions of them.

    Parameters
    ----------
    end : End
        The phototransistor.
    starts : Starts
        T points of walls.
    """

    def __init__(self, end: End, starts: Starts) -> None:
        self._end, size = end, max(PAIRS_AT_ONCE // len(end.points), 1)
        self._blocks = [starts.block(slice(first, first + size)) for first in range(0, max(len(starts.at), 1), size)]

    @cached_property
    def value(self) -> np.ndarray:
        """Power (T,) on the phototransistor, in W per W of light that falls on each point of the walls."""
        return np.concatenate([_ReceivedPairs(self._end, block).value for block in self._blocks])

    def gradient(self, adjoint: np.ndarray, wider: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the scalar product of ``adjoint`` and :attr:`value`.

        Parameters
        ----------
        adjoint : (T,) ndarray
            Weight of each point.
        wider : float
            Factor of the width over which the step at the horizon is smoothed.

        Returns
        -------
        by_start, by_normal : (T, 3) ndarray
            Derivatives with respect to the positions of the points, per mm, and to their unit normals.
        """
        ends = np.cumsum([len(block.at) for block in self._blocks])
        gradients = [
            _ReceivedPairs(self._end, block).gradient(weight, wider)
            for block, weight in zip(self._blocks, np.split(adjoint, ends[:-1]), strict=True)
        ]
        by_start, by_normal = (np.concatenate(vectors) for vectors in zip(*gradients, strict=True))
        return by_start, by_normal


class _ReceivedPairs:
    """All pairs of one point from a block of points on walls and one point of a phototransistor."""

    def __init__(self, end: End, starts: Starts) -> None:
        self._end, self._shape = end, (len(starts.at), len(end.points))
        start, point = (index.ravel() for index in np.indices(self._shape))
        self._exchange = Exchange(starts, end.points, end.weights[:, None] * end.normal, start, point)
        self._away = end.points - starts.at[:, None]
        self._distance = np.linalg.norm(self._away, axis=2)
        self._cosine = -(self._away @ end.normal) / self._distance
        self._response, self._slope = (values * (self._cosine > end.law.cutoff) for values in end.law(self._cosine))
        self._bare = self._exchange.values().reshape(self._shape)

    @property
    def value(self) -> np.ndarray:
        """Power (T,) on the phototransistor, in W per W of light that falls on each point of the walls; see
        :class:`Reception`.
        """
        return (self._bare * self._response).sum(axis=1)

    def gradient(self, adjoint: np.ndarray, wider: float) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the scalar product of ``adjoint`` and the value with respect to the positions of the points,
        per mm, and to their unit normals. ``wider`` is a factor of the width over which the step at the horizon is
        smoothed; see :meth:`Reception.gradient`."""
        slopes = self._exchange.slopes((adjoint[:, None] * self._response).ravel(), WIDER * wider)
        by_end, by_normal = (
            np.stack([component.reshape(self._shape).sum(axis=1) for component in vector], axis=1)
            for vector in (slopes.by_end, slopes.by_normal)
        )
        # The cosine is -(away . normal) / distance; its derivatives with respect to position and end have opposite
        # signs.
        turned = adjoint[:, None] * self._bare * self._slope / self._distance
        direction = self._away / self._distance[:, :, None]
        along = np.einsum("te,tec->tc", turned * self._cosine, direction)
        return along + turned.sum(axis=1)[:, None] * self._end.normal - by_end, by_normal


def acceptance(
    end: End, positions: np.ndarray, points: PatchPoints, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Light that a phototransistor accepts from equally bright patches, by two independent integrals: over the patches
    and along their outlines.

    Parameters
    ----------
    end : End
        The phototransistor.
    positions : (F, 15, 3) ndarray
        Positions of the patches, in mm.
    points : PatchPoints
        P quadrature points on the patches.
    weights : (P,) ndarray
        Their weights in integrals over s and t, as in the other integrals over walls.

    Returns
    -------
    by_rule, by_outline : (F,) ndarray
        Accepted light in mm² sr, for a sample of the points of the phototransistor. The second result is exact (see
        :func:`power_within`).
    """
    sample = slice(CHECKED // 2, None, CHECKED)
    at, area = points.positions_and_areas(positions)
    away = end.points[sample] - at[:, None]
    squared = (away**2).sum(axis=2)
    cosine = -(away @ end.normal) / np.sqrt(squared)
    facing = np.maximum(np.einsum("pkc,pc->pk", away, area), 0) / np.sqrt(squared)
    response = np.where(cosine > max(end.law.cutoff, 0.0), end.law(np.maximum(cosine, 0))[0], 0)
    accepted = (facing * response * np.maximum(cosine, 0) / squared) @ end.weights[sample]
    by_rule = np.bincount(points.face, weights * accepted, len(positions))
    total, within = _cumulative_acceptance(end.law)
    by_outline = total * end.weights[sample] @ power_within(end.points[sample], end.normal, within, positions)
    return by_rule, by_outline


def accepted(end: End, positions: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Light that a phototransistor accepts from patches, as :func:`acceptance` computes it, with the triangle rule of a
    given degree.

    Parameters
    ----------
    end : End
        The phototransistor.
    positions : (F, 15, 3) ndarray
        Positions of the patches, in mm.
    degree : int
        Degree of :func:`triangle_rule`.

    Returns
    -------
    by_rule, by_outline : (F,) ndarray
        Accepted light in mm² sr, as from :func:`acceptance`.
    """
    rule, weights = triangle_rule(degree)
    points = PatchPoints(np.repeat(np.arange(len(positions)), len(rule)), np.tile(rule, (len(positions), 1)))
    return acceptance(end, positions, points, np.tile(weights, len(positions)))


def radiance(
    end: End,
    received: np.ndarray,
    scattered: np.ndarray,
    area: np.ndarray,
    by_rule: np.ndarray,
    by_outline: np.ndarray,
) -> np.ndarray:
    """Radiance of patches towards a phototransistor.

    Parameters
    ----------
    end : End
        The phototransistor.
    received, scattered : (F,) ndarray
        Power in W from each patch, on the phototransistor and in all directions.
    area : (F,) ndarray
        Area of the patches, in mm².
    by_rule, by_outline : (F,) ndarray
        Results of :func:`acceptance`, in mm² sr.

    Returns
    -------
    (F,) ndarray
        Radiance in W per mm² and sr. Where the rule finds less than half of the outline's result, it is the mean
        radiance in all directions. It is 0 where the accepted light is below the resolution of the integrals along
        three sides.
    """
    sampled = end.weights[CHECKED // 2 :: CHECKED].sum() / end.weights.sum()
    visible = by_rule > np.abs(by_outline) / 2
    by_direction = np.where(visible, sampled * received / np.where(visible, by_rule, 1), scattered / (np.pi * area))
    resolved = np.maximum(by_rule, np.abs(by_outline)) > 3 * TOLERANCE * max(by_rule.sum(), by_outline.sum())
    return np.where(resolved, by_direction, 0)


def _cumulative_acceptance(law: AngularLaw) -> tuple[float, Cumulative]:
    """Integral of response times cosine over all directions. Also returns a function: the fraction of this integral
    over directions whose cosine is at least a given value.
    """
    if isinstance(law, CosineFactor):  # the product is such a law as well, whose integral has a closed form
        product = replace(law, exponent=law.exponent + 1)
        total = float(product.within(np.zeros(1))[0])
        return total, lambda cosine: product.within(cosine) / total
    angles = np.linspace(0, min(law.spread, np.pi / 2), ANGLES + 1)
    node, weight = gauss(3)
    theta = angles[:-1, None] + np.diff(angles)[:, None] * node
    values = 2 * np.pi * np.sin(theta) * np.cos(theta) * law(np.cos(theta))[0]
    sums = np.concatenate([[0.0], np.cumsum(np.diff(angles) * (values @ weight))])
    cosines = np.cos(angles)
    return float(sums[-1]), lambda cosine: np.interp(cosine, cosines[::-1], sums[::-1] / sums[-1])
