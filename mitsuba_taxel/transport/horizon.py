"""Pieces of patches that cross the horizon of a point from which light starts.

Isotropic light ends at the horizon with a step, which the points of a quadrature rule do not resolve: under load, a
bent roof hides a strip of the wall beside it from most of its points, and that strip is narrower than a patch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.transport.pairs import Pairs
from mitsuba_taxel.transport.pieces import WHOLE
from mitsuba_taxel.transport.rules import coefficients, monomials

ALONG = 0.9
"""Cosine between the normals of start and patch above which both belong to one smooth wall. Its pieces are not treated
as crossed: curved pieces beside a start only touch its horizon."""


class PiecesAtHorizon(NamedTuple):
    """M pairs of a point from which light starts, and a point on a piece of a wall that crosses the horizon of the
    start.

    Attributes
    ----------
    pairs : (M,) ndarray
        Numbers of the pairs.
    fraction : (M,) ndarray
        Fraction of the area of the piece that is above the horizon.
    by_height : (M / Q, Q) ndarray
        Derivatives per mm of the fraction of each piece with respect to the heights of its Q points.
    """

    pairs: np.ndarray
    fraction: np.ndarray
    by_height: np.ndarray


def pieces_at_horizon(pairs: Pairs, own: np.ndarray, normal: np.ndarray, leaving: np.ndarray) -> PiecesAtHorizon:
    """Find the pieces of walls that cross the horizon of a point from which light starts, except pieces of the same
    wall.

    Parameters
    ----------
    pairs : Pairs
        N pairs of T targets and the points of pieces, from :func:`pairs_of`.
    own : (T,) ndarray
        Number of the patch of each target.
    normal : (T, 3) ndarray
        Unit normals of the targets.
    leaving : (N,) ndarray
        Heights in mm of the points above the horizons of the targets.

    Returns
    -------
    PiecesAtHorizon
        Results in the order of the pairs.
    """
    of_patch = normal.reshape(int(own[-1]) + 1, -1, 3).mean(axis=1)
    patch = pairs.points.face[pairs.point]
    along = (normal @ of_patch.T > ALONG)[pairs.target, patch]
    # The points of a piece are consecutive; the polynomial through their heights gives the heights of the corners.
    numbers = np.flatnonzero(own[pairs.target] != patch).reshape(-1, pairs.interpolation.shape[1])
    numbers = numbers[~along[numbers[:, 0]]]
    to_corners = monomials(WHOLE, pairs.degree) @ coefficients(pairs.degree)
    heights = leaving[numbers] @ to_corners.T
    crossed = (heights.min(axis=1) < 0) & (heights.max(axis=1) > 0)
    fraction, by_corner = fraction_above(heights[crossed])
    return PiecesAtHorizon(numbers[crossed].ravel(), np.repeat(fraction, numbers.shape[1]), by_corner @ to_corners)


def fraction_above(heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fractions of the areas of triangles on which a linear function is positive.

    Parameters
    ----------
    heights : (M, 3) ndarray
        Values of the function at the corners; at least one of them is negative and one positive.

    Returns
    -------
    fraction : (M,) ndarray
        Fraction from 0 to 1.
    by_corner : (M, 3) ndarray
        Derivatives of the fraction with respect to the values.
    """
    # The zero line cuts off one corner, the tip, which is above it (``tip_above``) or below it.
    order = np.argsort(heights, axis=1)
    low, middle, high = np.take_along_axis(heights, order, axis=1).T
    tip_above = middle <= 0
    tip, opposite = np.where(tip_above, high, low), np.where(tip_above, low, high)
    # Area of the triangle between the tip and the line, relative to the entire triangle, and its derivatives.
    cut_off = tip**2 / ((tip - opposite) * (tip - middle))
    by_tip = cut_off * (2 / tip - 1 / (tip - opposite) - 1 / (tip - middle))
    by_opposite, by_middle = cut_off / (tip - opposite), cut_off / (tip - middle)
    # Back to the order of the corners, and from the part below the line to the part above it.
    by_sorted = np.stack(
        [np.where(tip_above, by_opposite, by_tip), by_middle, np.where(tip_above, by_tip, by_opposite)], axis=1
    )
    by_corner = np.empty_like(by_sorted)
    np.put_along_axis(by_corner, order, np.where(tip_above, 1, -1)[:, None] * by_sorted, axis=1)
    return np.where(tip_above, cut_off, 1 - cut_off), by_corner
