"""The integral over patches seen from targets, as a sum over pairs of targets and points.

The closer a patch, the more points: it is subdivided into pieces, to each of which the quadrature rule of patches is
applied. The subdivision does not change with the load, so that the sum is a smooth function of positions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.transport.patches import PatchPoints
from mitsuba_taxel.transport.pieces import cut_near
from mitsuba_taxel.transport.rules import coefficients, monomials, polar_rule, triangle_rule

SELF_POINTS = 8
"""Points along and across each of the three triangles into which a patch is subdivided for a target on it."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of targets and points.

    Attributes
    ----------
    target, point : (N,) ndarray
        Numbers of target and point of each pair, ordered by target.
    weight : (N,) ndarray
        Of the point in the integral over s and t.
    points : PatchPoints
        All points.
    degree : int
        Of the polynomials of values on patches.
    """

    target: np.ndarray
    point: np.ndarray
    weight: np.ndarray
    points: PatchPoints
    degree: int

    @cached_property
    def shares(self) -> np.ndarray:
        """(P, Q) weights of the values on a patch for the value at each point."""
        return monomials(self.points.at, self.degree) @ coefficients(self.degree)


def pairs_of(targets: np.ndarray, places: np.ndarray, own: np.ndarray, degree: int, distance: float) -> Pairs:
    """The pairs of ``targets`` (T, 3) with all patches of ``places`` (F, 15, 3).

    Parameters
    ----------
    own : (T,) ndarray
        Number of the patch of each target; targets are the points of :func:`triangle_rule`, patch by patch.
    degree : int
        Of that rule, which is applied to each piece.
    distance : float
        See :func:`cut_near`.
    """
    rule, weights = triangle_rule(degree)
    target, point, weight, face, at, count = [], [], [], [], [], 0
    for of_target, which, pieces in cut_near(targets, places, own, distance):
        target.append(np.repeat(of_target, len(rule)))
        point.append((count + len(rule) * which[:, None] + np.arange(len(rule))).ravel())
        weight.append(np.outer(pieces.areas()[which], weights).ravel())
        face.append(np.repeat(pieces.face, len(rule)))
        at.append(pieces.points(rule).reshape(-1, 2))
        count += face[-1].size
    rules = [polar_rule(place, SELF_POINTS) for place in rule]
    size = len(rules[0][1])
    target.append(np.repeat(np.arange(len(own)), size))
    point.append(np.arange(count, count + size * len(own)))
    weight.append(np.tile(np.concatenate([weights for _, weights in rules]), len(places)))
    face.append(np.repeat(own, size))
    at.append(np.tile(np.concatenate([points for points, _ in rules]), (len(places), 1)))
    faces = np.concatenate(face)
    order = np.argsort(faces, kind="stable")
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    of_target = np.concatenate(target)
    by_target = np.argsort(of_target, kind="stable")
    return Pairs(
        of_target[by_target],
        number[np.concatenate(point)[by_target]],
        np.concatenate(weight)[by_target],
        PatchPoints(faces[order], np.concatenate(at)[order]),
        degree,
    )
