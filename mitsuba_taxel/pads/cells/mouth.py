"""Rounded edges of cells' mouths, between the straight side and the bottom of the pad.

A ball of the fillet's radius reaches all silicone at the edge from within the silicone. The side therefore ends
tangentially at the board, and below the fillet there is air. The fillet belongs to the side.

Points are described by two coordinates: the horizontal distance d outwards from the side of the cell with sharp edges,
and the height z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mitsuba_taxel.pads.cells.fillet import ARC_POINTS, LEAST, MOST, refused

ROUND_MOUTH = "mouth"
"""Name of the rounded faces of solids at mouths."""


@dataclass(frozen=True)
class Mouth:
    """The rounded edge of the mouth of an upright cell, which is centred at the origin.

    Attributes
    ----------
    half : float
        Half the width of the sharp mouth, mm.
    radius : float
        Radius of the fillet, mm.
    slope : float
        Derivative of the distance of the side from the axis by the height.
    corner : float or None
        Radius of the upright edges of a square section, mm; None for a round section.
    straight : float
        Height up to which the side is straight, mm.
    beside : float
        Thickness of the silicone beside the mouth, mm.
    """

    half: float
    radius: float
    slope: float
    corner: float | None
    straight: float
    beside: float

    @property
    def width(self) -> float:
        """Distance from the sharp edge at which the fillet meets the bottom, and the side, mm."""
        return self.radius / math.tan(0.5 * math.atan2(1.0, self.slope))

    @property
    def height(self) -> float:
        """Height of the fillet, mm."""
        return self.width / math.hypot(1.0, self.slope)

    def coordinates(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances of points from the side wall of the cell with a sharp mouth, and the directions in which these
        distances grow.

        Parameters
        ----------
        points : (N, 3) ndarray
            Positions relative to the middle of the mouth, mm.

        Returns
        -------
        distance : (N,) ndarray
            Distance d in mm, negative within the sharp cell.
        outwards : (N, 2) ndarray
            Unit vectors.
        """
        _, _, outwards, length = self._from_core(points)
        return length - (self.half - self._core) - self.slope * points[:, 2], outwards

    def onto_arc(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Move points at the sharp or rounded edge of the mouth onto the arc of the fillet, towards the axis of its
        circle.

        Parameters
        ----------
        points : (N, 3) ndarray
            Positions relative to the middle of the mouth, mm.

        Returns
        -------
        projected : (N, 3) ndarray
            Projected positions, mm.
        gradient : (N, 3, 3) ndarray
            Derivative of the projected positions by the points.
        """
        nearest, along, outwards, length = self._from_core(points)
        from_centre = np.column_stack([length, points[:, 2]]) - self._centre
        distance = np.linalg.norm(from_centre, axis=1)[:, None]
        unit = from_centre / distance
        on_arc = self._centre + self.radius * unit
        in_plane = (self.radius / distance)[:, :, None] * (np.eye(2) - unit[:, :, None] * unit[:, None, :])
        # Horizontally, the nearest point of the core follows the point along axes; around corners the direction turns.
        radial = outwards[:, :, None] * outwards[:, None, :]
        turning = on_arc[:, 0] / np.where(length == 0, np.inf, length)
        gradient = np.zeros((len(points), 3, 3))
        gradient[:, :2, :2] = along + turning[:, None, None] * (np.eye(2) - along - radial)
        gradient[:, :2, :2] += in_plane[:, :1, :1] * radial
        gradient[:, :2, 2] = in_plane[:, 0, 1, None] * outwards
        gradient[:, 2, :2] = in_plane[:, 1, 0, None] * outwards
        gradient[:, 2, 2] = in_plane[:, 1, 1]
        return np.column_stack([nearest + on_arc[:, :1] * outwards, on_arc[:, 1]]), gradient

    def onto_sharp_edge(self, points: np.ndarray) -> np.ndarray:
        """Inverse of the rounding: for points on the rounded mouth, the points of the sharp-edged cell from which the
        rounding moved them.

        Parameters
        ----------
        points : (N, 3) ndarray
            Points on the fillet, relative to the middle of the mouth, mm.

        Returns
        -------
        (N, 3) ndarray
            Positions in mm.
        """
        nearest, _, outwards, length = self._from_core(points)
        from_centre = np.column_stack([length, points[:, 2]]) - self._centre
        to_bottom = -from_centre[:, 1]
        to_side = from_centre @ np.array([-1.0, self.slope]) / math.hypot(1.0, self.slope)
        # The bottom and the side are tangents: both are as far from the centre as the fillet.
        sharp = self._centre + from_centre * (self.radius / np.maximum(to_bottom, to_side))[:, None]
        return np.column_stack([nearest + sharp[:, :1] * outwards, sharp[:, 1]])

    def outline(self) -> np.ndarray:
        """The outline (M, 2) of the rounded edge in the plane (r, z), from the side to the bottom, mm."""
        angles = np.linspace(math.pi - math.atan(self.slope), 1.5 * math.pi, ARC_POINTS)
        arc = np.column_stack([np.cos(angles), np.sin(angles)])
        return self._centre + [self._core, 0.0] + self.radius * arc

    def solid(self, x: float, y: float, below: float) -> Any:
        """The air below the fillet as a solid, whose faces are named `ROUND_MOUTH`; it overlaps the sharp cell.

        Parameters
        ----------
        x, y : float
            Position of the cell's axis on the board, mm.
        below : float
            Lowest z of the solid, mm.

        Returns
        -------
        netgen.occ.TopoDS_Shape
            The solid.
        """
        from netgen.occ import ArcOfCircle, Axis, Face, Pnt, Segment, Vec, Wire, Z

        top, middle, foot = self.outline()[[0, ARC_POINTS // 2, -1]] - [self._core, 0.0]

        def section(inner: float) -> Any:
            """The cross-section of the air below the fillet, from a vertical line to the arc, in the plane of the
            distance from the core and the height.
            """
            corners = [(top[0], top[1]), (inner, top[1]), (inner, below), (foot[0], below), (foot[0], 0.0)]
            points = [Pnt(float(r), 0.0, float(z)) for r, z in corners]
            lines = [Segment(a, b) for a, b in pairwise(points) if (a - b).Norm() > 1e-9 * self.half]
            arc = ArcOfCircle(points[-1], Pnt(float(middle[0]), 0.0, float(middle[1])), points[0])
            return Face(Wire([*lines, arc]))

        axis = Axis(Pnt(0, 0, 0), Z)
        if self.corner is None:
            solid = section(0.0).Revolve(axis, 360)
        else:
            core = self._core
            corner = section(0.0).Move(Vec(core, core, 0)).Revolve(Axis(Pnt(core, core, 0), Z), 90)
            quarter = section(-core).Move(Vec(core, -core, 0)).Extrude(Vec(0, 2 * core, 0)) + corner
            solid = quarter
            for angle in (90, 180, 270):
                solid = solid + quarter.Rotate(axis, angle)
        solid.faces.name = ROUND_MOUTH
        return solid.Move(Vec(x, y, 0))

    @property
    def _core(self) -> float:
        """Half the side in mm of the square core of the cell's section. The distance of a point from the wall is
        measured from the nearest point of this core."""
        return 0.0 if self.corner is None else self.half - self.corner

    @property
    def _centre(self) -> np.ndarray:
        """Centre (2,) of the fillet's circle: its distance from the core of the section, and its height, mm."""
        return np.array([self.half - self._core + self.width, self.radius])

    def _from_core(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Nearest points (N, 2) of the core, their derivatives (N, 2, 2) by the points, and directions (N, 2) and
        distances (N,) of the points from there; distances are negative within the core."""
        across = points[:, :2]
        nearest = np.clip(across, -self._core, self._core)
        inside = (nearest == across).all(axis=1)
        rows, axis = np.flatnonzero(inside), np.abs(across[inside]).argmax(axis=1)
        nearest[rows, axis] = np.where(across[rows, axis] < 0, -self._core, self._core)
        away = across - nearest
        outwards = away / np.maximum(np.linalg.norm(away, axis=1), np.finfo(float).tiny)[:, None]
        outwards[inside] = 0.0
        outwards[rows, axis] = np.where(across[rows, axis] < 0, -1.0, 1.0)
        follows = away == 0
        follows[rows, axis] = False
        if self.corner is None:
            follows[:] = False
        return nearest, follows[:, :, None] * np.eye(2), outwards, (away * outwards).sum(axis=1)


def mouth(
    name: str, half: float, radius: float, slope: float, corner: float | None, straight: float, beside: float
) -> Mouth:
    """Create the rounded edge of a cell's mouth.

    Parameters
    ----------
    name : str
        Name of the parameter that gives the radius.
    half, radius, slope, corner, straight, beside : float
        See `Mouth`.

    Returns
    -------
    Mouth
        The fillet, with lengths in mm.

    Raises
    ------
    InputError
        if the fillet is too small or does not fit.
    """
    unit = Mouth(half, 1.0, slope, corner, straight, beside)
    largest = MOST * min(beside / unit.width, straight / unit.height)
    if not LEAST * 2 * half <= radius <= largest:
        limits = "the silicone beside the mouth and of the straight side"
        raise refused(radius, 2 * half, largest, name, limits)
    return Mouth(half, radius, slope, corner, straight, beside)
