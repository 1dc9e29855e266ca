"""Patches cut into smaller curved triangles along a plane, where the light that they receive or send has a kink."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.transport.patches import DEGREE, LATTICE
from mitsuba_taxel.transport.pieces import WHOLE
from mitsuba_taxel.transport.rules import monomials

BESIDE = 0.02
"""Distance of a corner from the plane, relative to that of the farthest corner, up to which it counts as in the
plane."""
ROUNDED = 6
"""Decimals of the coordinates of corners, so that cells that are equal but for rounding are cut equally."""
_COEFFICIENTS = np.linalg.inv(monomials(LATTICE, DEGREE))


@dataclass(frozen=True, eq=False)
class PatchCuts:
    """C triangles that together cover F patches, some of which are cut along a plane.

    Attributes
    ----------
    parent : (C,) ndarray
        Number of the patch, in ascending order.
    corners : (C, 3, 2) ndarray
        Corners as (s, t) on the patch.
    """

    parent: np.ndarray
    corners: np.ndarray

    def __post_init__(self) -> None:
        sides = self.corners[:, 1:] - self.corners[:, :1]
        points = (self.corners[:, :1] + LATTICE @ sides).reshape(-1, 2)
        weights = (monomials(points, DEGREE) @ _COEFFICIENTS).reshape(-1, len(LATTICE), len(LATTICE))
        object.__setattr__(self, "_weights", weights)

    def of(self, values: np.ndarray) -> np.ndarray:
        """Interpolate values (F, 15, 3), given at the points of the patches, at the 15 points of each triangle: (C, 15,
        3).
        """
        return self._weights @ values[self.parent]  # type: ignore[attr-defined]


def uncut(count: int) -> PatchCuts:
    """A `PatchCuts` object for patches that are not cut: one triangle covers each patch.

    Parameters
    ----------
    count : int
        Number of patches.

    Returns
    -------
    PatchCuts
        One triangle for each patch.
    """
    return PatchCuts(np.arange(count), np.tile(WHOLE, (count, 1, 1)))


def cut_at_plane(positions: np.ndarray, point: np.ndarray, normal: np.ndarray) -> PatchCuts:
    """Patches cut where they cross a plane, each into a triangle on one side and two on the other.

    Parameters
    ----------
    positions : (F, 15, 3) ndarray
        Positions of the patches in mm.
    point, normal : (3,) ndarray
        A point and the normal of the plane.

    Returns
    -------
    PatchCuts
        The triangles of all patches.
    """
    at_corners = [int(np.abs(LATTICE - corner).sum(axis=1).argmin()) for corner in WHOLE]
    heights = (positions[:, at_corners] - point) @ normal
    heights[np.abs(heights) < BESIDE * np.abs(heights).max(axis=1, keepdims=True)] = 0.0
    parent, corners = [], []
    for number, height in enumerate(heights):
        triangles = [WHOLE] if height.min() >= 0 or height.max() <= 0 else _cut(height)
        parent += [number] * len(triangles)
        corners += triangles
    return PatchCuts(np.array(parent), np.round(corners, ROUNDED))


def _cut(height: np.ndarray) -> list[np.ndarray]:
    """Cut the unit triangle along the line on which a linear function is 0. The function is given by its values (3,) at
    the corners; returns the triangles (3, 2) on both sides."""
    # The line cuts off one corner, a, and meets the sides ab and ac.
    above = height > 0
    tip = int(np.argmax(above == (above.sum() == 1)))
    (a, b, c), (at_a, at_b, at_c) = np.roll(WHOLE, -tip, axis=0), np.roll(height, -tip)
    beside_b, beside_c = a + (b - a) * at_a / (at_a - at_b), a + (c - a) * at_a / (at_a - at_c)
    # The quadrilateral on the other side is divided along its shorter diagonal; triangles without area are left out.
    if np.linalg.norm(beside_b - c) < np.linalg.norm(beside_c - b):
        rest = [(beside_b, b, c), (beside_b, c, beside_c)]
    else:
        rest = [(beside_b, b, beside_c), (b, c, beside_c)]
    triangles = np.array([(a, beside_b, beside_c), *rest])
    sides = triangles[:, 1:] - triangles[:, :1]
    return [triangle for triangle, (u, v) in zip(triangles, sides, strict=True) if u[0] * v[1] != u[1] * v[0]]
