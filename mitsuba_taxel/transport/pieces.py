"""Pieces of patches, subdivided as finely as nearby targets need."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.transport.patches import PatchPoints

MOST_CUTS = 7
FEW = 4
"""Numbers are sorted where fewer than one of so many occurs, as small pieces lie near targets alone."""
WHOLE = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
QUARTERS = np.stack([WHOLE / 2, WHOLE / 2 + (0.5, 0), WHOLE / 2 + (0, 0.5), 0.5 - WHOLE[[0, 1, 2]] / 2])
"""(4, 3, 2) corners of the four quarters of a triangle."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Triangles on patches.

    Attributes
    ----------
    face : (M,) ndarray
        Number of the patch.
    corners : (M, 3, 2) ndarray
        As (s, t).
    """

    face: np.ndarray
    corners: np.ndarray

    def points(self, rule: np.ndarray) -> np.ndarray:
        """(M, Q, 2) points (s, t) of a rule (Q, 2) on each."""
        sides = self.corners[:, 1:] - self.corners[:, :1]
        return self.corners[:, :1] + rule @ sides

    def areas(self) -> np.ndarray:
        """(M,) shares of the patch's area."""
        (a, b), (c, d) = (self.corners[:, 1:] - self.corners[:, :1]).transpose(1, 2, 0)
        return np.abs(a * d - b * c)

    def extents(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Middle (M, 3) and longest side (M,) in mm, on patches with ``places`` (F, 15, 3)."""
        corners = self.points(WHOLE).reshape(-1, 2)
        at = PatchPoints(np.repeat(self.face, 3), corners).places(places).reshape(-1, 3, 3).transpose(1, 0, 2)
        sides = [np.linalg.norm(at[k] - at[k - 1], axis=1) for k in range(3)]
        return at.mean(axis=0), np.max(sides, axis=0)


def quartered(corners: np.ndarray) -> np.ndarray:
    """(4 M, 3, 2) corners of the quarters of pieces (M, 3, 2), one piece after the other."""
    start, sides = corners[:, None, None, 0], corners[:, 1:] - corners[:, :1]
    return (start + QUARTERS @ sides[:, None]).reshape(-1, 3, 2)


def cut_near(
    targets: np.ndarray, places: np.ndarray, own: np.ndarray | None, distance: float
) -> Iterator[tuple[np.ndarray, np.ndarray, Pieces]]:
    """Pairs of targets and pieces that together cover all patches, grouped by the size of the pieces.

    Parameters
    ----------
    targets : (T, 3) ndarray
        In mm.
    places : (F, 15, 3) ndarray
        Of the patches, in mm.
    own : (T,) ndarray or None
        Patch of each target, with which it forms no pair.
    distance : float
        Distance from a target to the middle of a piece, relative to its longest side, from which it is not subdivided.

    Yields
    ------
    Targets (N,), numbers of pieces (N,), and these pieces.
    """
    target, face = (index.ravel() for index in np.indices((len(targets), len(places))))
    if own is not None:
        other = own[target] != face
        target, face = target[other], face[other]
    number, corners = face, WHOLE[None]  # pieces of a size: face by face, corners those of one patch
    for cut in range(MOST_CUTS + 1):
        used, which = _numbered(number, len(places) * len(corners))
        pieces = Pieces(used // len(corners), corners[used % len(corners)])
        middle, size = pieces.extents(places)
        away = middle[which] - targets[target]
        near = (away**2).sum(axis=1) < (distance * size[which]) ** 2
        if cut == MOST_CUTS:
            near[:] = False
        yield target[~near], which[~near], pieces
        if not near.any():
            return
        target, number = np.repeat(target[near], 4), (4 * number[near][:, None] + np.arange(4)).ravel()
        corners = quartered(corners)


def _numbered(number: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Which of ``count`` numbers occur, in ascending order, and the place of each number (N,) among them."""
    if count > FEW * len(number):
        return np.unique(number, return_inverse=True)
    there = np.zeros(count, dtype=bool)
    there[number] = True
    return np.flatnonzero(there), np.cumsum(there)[number] - 1
