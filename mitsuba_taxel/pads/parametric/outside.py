"""Rounded edges of the outside of a pad: upright, and around the top. The edges at the board remain sharp."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.pads.cells.fillet import LEAST, MOST, refused

ROUND_OUTSIDE = "outer_edge"
"""Name of the rounded faces of the outside of solids."""


@dataclass(frozen=True)
class Outside:
    """The outer surface of a pad with rounded edges.

    The rounded block consists of all points within ``radius`` of a smaller block (the Minkowski sum of this block and a
    ball).

    Attributes
    ----------
    extent : tuple[float, float, float]
        Dimensions of the sharp block along x, y and z, mm; its bottom is z = 0, and its centre x = y = 0.
    radius : float
        Radius of the ball, mm.
    """

    extent: tuple[float, float, float]
    radius: float

    def onto_rounded(self, points: np.ndarray) -> np.ndarray:
        """Project points on or near the outside, sharp or rounded, onto the nearest points of the rounded outside.

        Parameters
        ----------
        points : (N, 3) ndarray
            Positions in mm.

        Returns
        -------
        (N, 3) ndarray
            Positions in mm.
        """
        nearest, away = self._from_core(points)
        return nearest + away * (self.radius / np.linalg.norm(away, axis=1))[:, None]

    def onto_sharp(self, points: np.ndarray) -> np.ndarray:
        """Inverse of the rounding: for points on the rounded outside, the points of the sharp-edged outside from which
        the rounding moved them.

        Parameters
        ----------
        points : (N, 3) ndarray
            Points on the rounded outside, mm.

        Returns
        -------
        (N, 3) ndarray
            Positions in mm.
        """
        nearest, away = self._from_core(points)
        return nearest + away * (self.radius / np.abs(away).max(axis=1))[:, None]

    def solid(self) -> Any:
        """The block with rounded edges as a solid, with faces named ``bottom``, ``top``, ``outer`` and
        `ROUND_OUTSIDE`.

        Returns
        -------
        netgen.occ.TopoDS_Shape
            The solid.
        """
        from netgen.occ import Box, Pnt, Z

        x, y, height = 0.5 * self.extent[0], 0.5 * self.extent[1], self.extent[2]
        block = Box(Pnt(-x, -y, 0), Pnt(x, y, height))
        block = block.MakeFillet([edge for edge in block.edges if edge.bounding_box[1].z > 0.5 * height], self.radius)
        for face in block.faces:
            low, high = face.bounding_box
            is_plane = min(high.x - low.x, high.y - low.y, high.z - low.z) < 0.01 * self.radius
            face.name = "outer" if is_plane else ROUND_OUTSIDE
        block.faces.Min(Z).name = "bottom"
        block.faces.Max(Z).name = "top"
        return block

    def _from_core(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the inner block of the rounded outside, and vectors from there to the points. The inner
        block has no lower end."""
        high = np.array([0.5, 0.5, 1.0]) * self.extent - self.radius
        nearest = np.clip(points, [-high[0], -high[1], -np.inf], high)
        return nearest, points - nearest


def outside(extent: tuple[float, float, float], radius: float, wall: float, cell_size: float) -> Outside:
    """Create the outside of a pad with rounded edges.

    Parameters
    ----------
    extent : tuple[float, float, float]
        Dimensions of the sharp block along x, y and z, mm. See `Outside`.
    radius : float
        Radius of the fillets, mm.
    wall : float
        Thickness of the silicone beside the outermost cells, mm.
    cell_size : float
        Width of the cells, mm.

    Returns
    -------
    Outside
        The outside, with lengths in mm.

    Raises
    ------
    InputError
        if the fillets are too small or do not fit.
    """
    largest = MOST * min(wall, 0.5 * extent[2])
    if not LEAST * cell_size <= radius <= largest:
        raise refused(radius, cell_size, largest, "outer_fillet", "the wall and of half the height")
    return Outside(extent, radius)
