"""Integrals over patches as seen from targets, as sums over pairs of a target and a point.

A patch is subdivided into pieces, and the quadrature rule is applied to each piece: the closer the target, the more
pieces. The subdivision does not change with the load, so that the sum is a smooth function of positions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.transport.patches import PatchPoints
from mitsuba_taxel.transport.pieces import cut_near
from mitsuba_taxel.transport.rules import coefficients, monomials, polar_rule, triangle_rule

SELF_POINTS = 8
"""Points along and across each of the three triangles into which a patch is divided for a target on the patch."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """N pairs of a target (a point at which light is computed) and a quadrature point on a patch.

    Attributes
    ----------
    target, point : (N,) ndarray
        Numbers of target and point of each pair, ordered by target.
    weight : (N,) ndarray
        Weight of the point in the integral over s and t.
    points : PatchPoints
        All P points.
    degree : int
        Degree of the polynomials that interpolate values on patches.
    """

    target: np.ndarray
    point: np.ndarray
    weight: np.ndarray
    points: PatchPoints
    degree: int

    @cached_property
    def interpolation(self) -> np.ndarray:
        """Weights (P, Q) with which the Q values on a patch are interpolated at each of its points."""
        return monomials(self.points.at, self.degree) @ coefficients(self.degree)


def pairs_of(targets: np.ndarray, positions: np.ndarray, own: np.ndarray, degree: int, distance: float) -> Pairs:
    """Pairs of each target with the quadrature points of all patches.

    Parameters
    ----------
    targets : (T, 3) ndarray
        Positions in mm of the points of :func:`triangle_rule`, patch by patch.
    positions : (F, 15, 3) ndarray
        Positions of the patches, in mm.
    own : (T,) ndarray
        Number of the patch of each target.
    degree : int
        Degree of the triangle rule, which is applied to each piece of the other patches.
    distance : float
        Distance from a target to the middle of a piece, relative to its longest side: a piece at a smaller distance is
        subdivided. See :func:`cut_near`.

    Returns
    -------
    Pairs
        Pairs ordered by target.
    """
    rule, weights = triangle_rule(degree)
    target, point, weight, face, at, count = [], [], [], [], [], 0
    # The other patches, in pieces.
    for of_target, piece, pieces in cut_near(targets, positions, own, distance):
        target.append(np.repeat(of_target, len(rule)))
        point.append((count + len(rule) * piece[:, None] + np.arange(len(rule))).ravel())
        weight.append(np.outer(pieces.areas()[piece], weights).ravel())
        face.append(np.repeat(pieces.face, len(rule)))
        at.append(pieces.points(rule).reshape(-1, 2))
        count += face[-1].size
    # The patch of the target itself, where the integrand grows as 1 / distance.
    rules = [polar_rule(corner, SELF_POINTS) for corner in rule]
    size = len(rules[0][1])
    target.append(np.repeat(np.arange(len(own)), size))
    point.append(np.arange(count, count + size * len(own)))
    weight.append(np.tile(np.concatenate([weights for _, weights in rules]), len(positions)))
    face.append(np.repeat(own, size))
    at.append(np.tile(np.concatenate([points for points, _ in rules]), (len(positions), 1)))
    # Points are ordered by patch, as `PatchPoints` needs them, and pairs by target.
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
