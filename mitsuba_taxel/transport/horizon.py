"""Pieces of patches that the horizon of a start crosses.

Isotropic light ends there with a step, which points of a quadrature rule do not resolve: under load, a bent roof hides
a strip of the wall beside it from most of its points, and that strip is narrower than a patch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.transport.pairs import Pairs
from mitsuba_taxel.transport.pieces import WHOLE
from mitsuba_taxel.transport.rules import coefficients, monomials

ALONG = 0.9
"""Cosine between normals of start and patch above which both belong to one smooth wall, whose own light is left as it
is: curved pieces beside a start only touch its horizon."""


class PiecesAtHorizon(NamedTuple):
    """Pairs of starts and points of such pieces.

    Attributes
    ----------
    pairs : (M,) ndarray
        Numbers of the pairs.
    share : (M,) ndarray
        Share of the area of the piece that is above the horizon.
    by_height : (M / Q, Q) ndarray
        Derivatives per mm of the share of each piece by the heights of its points.
    """

    pairs: np.ndarray
    share: np.ndarray
    by_height: np.ndarray


def pieces_at_horizon(pairs: Pairs, own: np.ndarray, normal: np.ndarray, leaving: np.ndarray) -> PiecesAtHorizon:
    """Pieces that the horizon crosses, except those of the wall of the start.

    Parameters
    ----------
    own : (T,) ndarray
        Number of the patch of each target.
    normal : (T, 3) ndarray
        Unit normals of the targets.
    leaving : (N,) ndarray
        Heights in mm of the points above the horizons of the targets.
    """
    of_patch = normal.reshape(int(own[-1]) + 1, -1, 3).mean(axis=1)
    patch = pairs.points.face[pairs.point]
    along = (normal @ of_patch.T > ALONG)[pairs.target, patch]
    # The points of a piece follow one another; heights at its corners are those of the polynomial through them.
    numbers = np.flatnonzero(own[pairs.target] != patch).reshape(-1, pairs.shares.shape[1])
    numbers = numbers[~along[numbers[:, 0]]]
    to_corners = monomials(WHOLE, pairs.degree) @ coefficients(pairs.degree)
    heights = leaving[numbers] @ to_corners.T
    crossed = (heights.min(axis=1) < 0) & (heights.max(axis=1) > 0)
    share, by_corner = share_above(heights[crossed])
    return PiecesAtHorizon(numbers[crossed].ravel(), np.repeat(share, numbers.shape[1]), by_corner @ to_corners)


def share_above(heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(M,) shares of triangles on which a linear function is positive, from its values (M, 3) at the corners, of which
    one at least is negative and one positive, and (M, 3) the derivatives by these."""
    order = np.argsort(heights, axis=1)
    low, middle, high = np.take_along_axis(heights, order, axis=1).T
    few = middle <= 0  # corners above the line: one, the tip of a triangle, or else one below it
    tip, far, near = np.where(few, high, low), np.where(few, low, high), middle
    share = tip**2 / ((tip - far) * (tip - near))
    by_tip = share * (2 / tip - 1 / (tip - far) - 1 / (tip - near))
    by_far, by_near = share / (tip - far), share / (tip - near)
    by_sorted = np.stack([np.where(few, by_far, by_tip), by_near, np.where(few, by_tip, by_far)], axis=1)
    by_corner = np.empty_like(by_sorted)
    np.put_along_axis(by_corner, order, np.where(few, 1, -1)[:, None] * by_sorted, axis=1)
    return np.where(few, share, 1 - share), by_corner
