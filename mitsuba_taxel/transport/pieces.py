"""Pieces of patches, subdivided as finely as nearby targets need."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.transport.patches import PatchPoints

MOST_CUTS = 7
"""Largest number of subdivisions of a patch."""
FEW = 4
"""If fewer than 1 in 4 of all possible numbers occur, as for small pieces near targets, the numbers are sorted; else a
mask is used."""
WHOLE = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
QUARTERS = np.stack([WHOLE / 2, WHOLE / 2 + (0.5, 0), WHOLE / 2 + (0, 0.5), 0.5 - WHOLE[[0, 1, 2]] / 2])
"""Corners (4, 3, 2) of the four quarters of a triangle."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """M triangular pieces of patches.

    Attributes
    ----------
    face : (M,) ndarray
        Number of the patch of each triangle.
    corners : (M, 3, 2) ndarray
        Corners as (s, t).
    """

    face: np.ndarray
    corners: np.ndarray

    def points(self, rule: np.ndarray) -> np.ndarray:
        """Points (s, t) (M, Q, 2) of a quadrature rule (Q, 2) on each piece."""
        sides = self.corners[:, 1:] - self.corners[:, :1]
        return self.corners[:, :1] + rule @ sides

    def areas(self) -> np.ndarray:
        """Areas (M,) of the pieces in the plane (s, t), relative to those of the patches."""
        (a, b), (c, d) = (self.corners[:, 1:] - self.corners[:, :1]).transpose(1, 2, 0)
        return np.abs(a * d - b * c)

    def extents(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centres and sizes of the pieces.

        Parameters
        ----------
        positions : (F, 15, 3) ndarray
            Positions of the patches, in mm.

        Returns
        -------
        middle : (M, 3) ndarray
            Mean of the corners, in mm.
        size : (M,) ndarray
            Longest side, in mm.
        """
        corners = self.points(WHOLE).reshape(-1, 2)
        at = PatchPoints(np.repeat(self.face, 3), corners).interpolated(positions).reshape(-1, 3, 3).transpose(1, 0, 2)
        sides = [np.linalg.norm(at[k] - at[k - 1], axis=1) for k in range(3)]
        return at.mean(axis=0), np.max(sides, axis=0)


def quartered(corners: np.ndarray) -> np.ndarray:
    """Corners (4 M, 3, 2) of the quarters of pieces (M, 3, 2), in the order of the pieces."""
    start, sides = corners[:, None, None, 0], corners[:, 1:] - corners[:, :1]
    return (start + QUARTERS @ sides[:, None]).reshape(-1, 3, 2)


def cut_near(
    targets: np.ndarray, positions: np.ndarray, own: np.ndarray | None, distance: float
) -> Iterator[tuple[np.ndarray, np.ndarray, Pieces]]:
    """For each target point, cover all patches with pieces that are small relative to their distance from the target.

    Pairs of targets and pieces are grouped by the size of the pieces.

    Parameters
    ----------
    targets : (T, 3) ndarray
        Positions of the targets in mm.
    positions : (F, 15, 3) ndarray
        Positions of the patches, in mm.
    own : (T,) ndarray or None
        Patch of each target, with which it forms no pair; None if targets lie on no patch.
    distance : float
        Distance from a target to the middle of a piece, relative to its longest side: a piece at a smaller distance is
        subdivided.

    Yields
    ------
    target : (N,) ndarray
        Number of the target of each pair.
    piece : (N,) ndarray
        Number of its piece.
    pieces : Pieces
        The pieces of this size.
    """
    target, face = (index.ravel() for index in np.indices((len(targets), len(positions))))
    if own is not None:
        is_pair = own[target] != face
        target, face = target[is_pair], face[is_pair]
    # Pieces of one size are numbered patch by patch; ``corners`` are those of the pieces of one patch.
    number, corners = face, WHOLE[None]
    for cut in range(MOST_CUTS + 1):
        count = len(positions) * len(corners)
        if count > FEW * len(number):
            used, piece = np.unique(number, return_inverse=True)
        else:
            occurs = np.zeros(count, dtype=bool)
            occurs[number] = True
            used, piece = np.flatnonzero(occurs), np.cumsum(occurs)[number] - 1
        pieces = Pieces(used // len(corners), corners[used % len(corners)])
        # Pieces that are large relative to their distance are subdivided for the targets concerned.
        middle, size = pieces.extents(positions)
        away = middle[piece] - targets[target]
        coarse = (away**2).sum(axis=1) < (distance * size[piece]) ** 2
        if cut == MOST_CUTS:
            coarse[:] = False
        yield target[~coarse], piece[~coarse], pieces
        if not coarse.any():
            return
        target, number = np.repeat(target[coarse], 4), (4 * number[coarse][:, None] + np.arange(4)).ravel()
        corners = quartered(corners)
