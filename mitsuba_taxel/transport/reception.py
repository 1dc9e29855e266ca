"""Response of a phototransistor to light scattered by walls."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.transport.exchange import Exchange, Starts
from mitsuba_taxel.transport.laws.ends import AngularLaw, End
from mitsuba_taxel.transport.outline import TOLERANCE, Cumulative, power_within
from mitsuba_taxel.transport.patches import PatchPoints
from mitsuba_taxel.transport.rules import gauss, triangle_rule

CHECKED, ANGLES = 7, 1024
"""One of so many points of a phototransistor is checked; parts of the angles that its response depends on."""
WIDER = 10.0
"""Width over which the step at the horizon of a wall is spread, relative to that between walls: the spacing of the
points of a phototransistor as seen from a wall nearby, whose horizon passes whole rows of them at once."""


class Reception:
    """Response to a watt at points (T) of walls."""

    def __init__(self, end: End, starts: Starts) -> None:
        self._end, self._shape = end, (len(starts.at), len(end.points))
        start, point = (index.ravel() for index in np.indices(self._shape))
        self._exchange = Exchange(starts, end.points, end.weights[:, None] * end.normal, start, point)
        self._away = end.points - starts.at[:, None]
        self._distance = np.linalg.norm(self._away, axis=2)
        self._cosine = -(self._away @ end.normal) / self._distance
        self._response, self._slope = (each * (self._cosine > end.law.cutoff) for each in end.law(self._cosine))
        self._bare = self._exchange.values().reshape(self._shape)

    @property
    def value(self) -> np.ndarray:
        """(T,) W per W."""
        return (self._bare * self._response).sum(axis=1)

    def gradient(self, adjoint: np.ndarray, wider: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (T, 3) of ``adjoint`` . :attr:`value` by the positions and by the unit normals of the walls, with
        a horizon that is ``wider`` by a factor."""
        slopes = self._exchange.slopes((adjoint[:, None] * self._response).ravel(), WIDER * wider)
        by_end, by_normal = (
            np.stack([part.reshape(self._shape).sum(axis=1) for part in each], axis=1)
            for each in (slopes.by_end, slopes.by_normal)
        )
        # The cosine is -(away . normal) / distance; its derivatives by position and end have opposite signs.
        turned = adjoint[:, None] * self._bare * self._slope / self._distance
        direction = self._away / self._distance[:, :, None]
        along = np.einsum("te,tec->tc", turned * self._cosine, direction)
        return along + turned.sum(axis=1)[:, None] * self._end.normal - by_end, by_normal


def acceptance(end: End, places: np.ndarray, points: PatchPoints, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a phototransistor accepts from patches that are all equally bright, by two integrals.

    Parameters
    ----------
    end : End
    places : (F, 15, 3) ndarray
        Of the patches, in mm.
    points : PatchPoints
    weights : (P,) ndarray
        Rule over s and t of each patch, by which other integrals over walls are computed.

    Returns
    -------
    by_rule, by_outline : (F,) ndarray
        In mm² sr, of some points of the phototransistor; the second is right (see :func:`power_within`).
    """
    some = slice(CHECKED // 2, None, CHECKED)
    at, area = points.placed(places)
    away = end.points[some] - at[:, None]
    squared = (away**2).sum(axis=2)
    cosine = -(away @ end.normal) / np.sqrt(squared)
    facing = np.maximum(np.einsum("pkc,pc->pk", away, area), 0) / np.sqrt(squared)
    response = np.where(cosine > max(end.law.cutoff, 0.0), end.law(np.maximum(cosine, 0))[0], 0)
    accepted = (facing * response * np.maximum(cosine, 0) / squared) @ end.weights[some]
    by_rule = np.bincount(points.face, weights * accepted, len(places))
    total, share = _accepted_within(end.law)
    by_outline = total * end.weights[some] @ power_within(end.points[some], end.normal, share, places)
    return by_rule, by_outline


def accepted(end: End, places: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """:func:`acceptance` by the triangle rule of a degree."""
    rule, weights = triangle_rule(degree)
    points = PatchPoints(np.repeat(np.arange(len(places)), len(rule)), np.tile(rule, (len(places), 1)))
    return acceptance(end, places, points, np.tile(weights, len(places)))


def radiance(
    end: End,
    received: np.ndarray,
    scattered: np.ndarray,
    area: np.ndarray,
    by_rule: np.ndarray,
    by_outline: np.ndarray,
) -> np.ndarray:
    """Radiance of patches towards a phototransistor, in W per mm² and sr.

    Parameters
    ----------
    end : End
    received, scattered : (F,) ndarray
        Power in W from each patch on the phototransistor, and in all directions.
    area : (F,) ndarray
        In mm².
    by_rule, by_outline : (F,) ndarray
        From :func:`acceptance`: patches that seem to be hidden have the radiance of all directions; those from which
        less is accepted than integrals along three sides resolve have none.
    """
    some = end.weights[CHECKED // 2 :: CHECKED].sum() / end.weights.sum()
    known = by_rule > np.abs(by_outline) / 2
    by_direction = np.where(known, some * received / np.where(known, by_rule, 1), scattered / (np.pi * area))
    resolved = np.maximum(by_rule, np.abs(by_outline)) > 3 * TOLERANCE * max(by_rule.sum(), by_outline.sum())
    return np.where(resolved, by_direction, 0)


def _accepted_within(law: AngularLaw) -> tuple[float, Cumulative]:
    """Integral of a response times the cosine over all directions, and its share in those of at least some cosines."""
    angles = np.linspace(0, min(law.spread, np.pi / 2), ANGLES + 1)
    place, weight = gauss(3)
    theta = angles[:-1, None] + np.diff(angles)[:, None] * place
    values = 2 * np.pi * np.sin(theta) * np.cos(theta) * law(np.cos(theta))[0]
    sums = np.concatenate([[0.0], np.cumsum(np.diff(angles) * (values @ weight))])
    cosines = np.cos(angles)
    return float(sums[-1]), lambda cosine: np.interp(cosine, cosines[::-1], sums[::-1] / sums[-1])
