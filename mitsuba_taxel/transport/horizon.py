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
    """

    pairs: np.ndarray
    share: np.ndarray


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
    heights = np.sort(leaving[numbers] @ to_corners.T, axis=1)
    crossed = (heights[:, 0] < 0) & (heights[:, 2] > 0)
    share = share_above(heights[crossed])
    return PiecesAtHorizon(numbers[crossed].ravel(), np.repeat(share, numbers.shape[1]))


def share_above(heights: np.ndarray) -> np.ndarray:
    """(M,) shares of triangles on which a linear function is positive, from its values (M, 3) at the corners, sorted,
    the first negative and the last positive."""
    low, middle, high = heights.T
    at_top = high**2 / ((high - low) * np.where(middle <= 0, high - middle, 1))
    at_bottom = low**2 / ((high - low) * np.where(middle > 0, middle - low, 1))
    return np.where(middle > 0, 1 - at_bottom, at_top)
