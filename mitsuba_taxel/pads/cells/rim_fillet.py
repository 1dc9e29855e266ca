"""Rounded rims of round cells.

Each point of the sharp wall has an image on the rounded wall: the nearest point of that wall, in the direction of the
centre of the ball that rolls along the rim."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.pads.cells.arc import Arc
from mitsuba_taxel.pads.cells.fillet import ARC_POINTS, LEAST, MOST, Fillet, refused
from mitsuba_taxel.pads.cells.meridian import SAMPLES, SMOOTH_RIM, Meridian, from_axis, onto_meridian, rim_angle

_ITERATIONS = 12
_BISECTIONS = 30


@dataclass(frozen=True, eq=False)
class RimFillet(Fillet):
    """The rounded edge between the roof and the side of a round cell: part of a torus.

    Attributes
    ----------
    roof, side : Meridian
        Meridian from the crown to the sharp rim, and from there to the board.
    arc : Arc
        The meridian of the fillet, from the side to the roof.
    """

    roof: Meridian
    side: Meridian
    arc: Arc

    @property
    def rim(self) -> np.ndarray:
        """Coordinates (2,) r and z of the sharp rim, mm."""
        return self.side.at(np.zeros(1))[0][0]

    @property
    def width(self) -> float:
        """Largest distance of the fillet's borders from the sharp rim, mm."""
        return float(np.linalg.norm(self.arc.at(self.arc.ends)[0] - self.rim, axis=1).max())

    def from_rim(self, points: np.ndarray) -> np.ndarray:
        """Distance of points from the sharp rim of the cell.

        Parameters
        ----------
        points : (N, 3) ndarray
            Positions in mm.

        Returns
        -------
        (N,) ndarray
            Distances in mm.
        """
        return np.linalg.norm(_in_plane(points) - self.rim, axis=1)

    def onto_wall(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        in_plane = _in_plane(points)
        on_arc, on_roof = self.arc.covers(in_plane), self._towards_roof(in_plane)
        projected, gradient = np.empty_like(points), np.empty((len(points), 3, 3))
        curves = ((self.arc, on_arc), (self.roof, on_roof & ~on_arc), (self.side, ~on_roof & ~on_arc))
        for curve, selected in curves:
            projected[selected], gradient[selected] = onto_meridian(curve, points[selected])
        return projected, gradient

    def onto_sharp_wall(self, points: np.ndarray) -> np.ndarray:
        """Inverse of the rounding: for points on the rounded wall, the points of the sharp-edged wall from which the
        rounding moved them.

        Parameters
        ----------
        points : (N, 3) ndarray
            Points on the rounded wall, mm.

        Returns
        -------
        (N, 3) ndarray
            Positions in mm.
        """
        in_plane = _in_plane(points)
        on_arc, on_roof = self.arc.covers(in_plane), self._towards_roof(in_plane)
        sharp = points.copy()
        # Newton's method for the intersection of rays from the centre with the sharp wall, from the rim.
        for curve, start, selected in ((self.roof, 1.0, on_arc & on_roof), (self.side, 0.0, on_arc & ~on_roof)):
            ray, u = in_plane[selected] - self.arc.centre, np.full(selected.sum(), start)
            for _ in range(_ITERATIONS):
                position, tangent, _ = curve.at(u)
                u = u - _cross(position - self.arc.centre, ray) / _cross(tangent, ray)
            position = curve.at(u)[0]
            sharp[selected, :2] *= (position[:, 0] / in_plane[selected, 0])[:, None]
            sharp[selected, 2] = position[:, 1]
        return sharp

    def slid(self, points: np.ndarray, origin: RimFillet) -> np.ndarray:
        """Move points along the roof of the sharp-edged cell. They move as far as the border of the fillet moves when
        the radius of the fillet changes.

        Parameters
        ----------
        points : (N, 3) ndarray
            Points on the sharp wall, mm.
        origin : RimFillet
            The fillet from whose border the points move to the border of this one.

        Returns
        -------
        (N, 3) ndarray
            Positions in mm.
        """
        in_plane = _in_plane(points)
        on_roof = self._towards_roof(in_plane)
        borders = [fillet.roof.nearest(fillet.arc.at(fillet.arc.ends[1:])[0])[0][0] for fillet in (origin, self)]
        u = self.roof.nearest(in_plane[on_roof])[0]
        position = self.roof.at(u + np.interp(u, [0.0, borders[0], 1.0], [0.0, borders[1] - borders[0], 0.0]))[0]
        slid = points.copy()
        slid[on_roof, :2] *= (position[:, 0] / in_plane[on_roof, 0])[:, None]
        slid[on_roof, 2] = position[:, 1]
        return slid

    def holds(self, points: np.ndarray, slack: float) -> np.ndarray:
        in_plane = _in_plane(points.reshape(-1, 3))
        beyond = np.linalg.norm(in_plane - self.arc.centre, axis=1) > self.arc.radius - slack
        return ~(beyond & self.arc.covers(in_plane)).reshape(points.shape[:-1])

    def outline(self) -> np.ndarray:
        arc = self.arc.at(np.linspace(self.arc.ends[1], self.arc.ends[0], ARC_POINTS))[0]
        return np.concatenate([self._roof_points(), arc, self.side.at(np.ones(1))[0]])

    def solid(self, x: float, y: float, below: float) -> Any:
        from netgen.occ import ArcOfCircle

        low, middle, high = self.arc.at(np.array([self.arc.ends[0], self.arc.ends.mean(), self.arc.ends[1]]))[0]
        return self._revolved(x, y, below, [ArcOfCircle(_point(low), _point(middle), _point(high))])

    def marked_solid(self, x: float, y: float, below: float) -> Any:
        """The sharp cell as a solid, with the rings that the fillet replaces named ``fillet``.

        Parameters
        ----------
        x, y : float
            Position of its axis on the board, mm.
        below : float
            Lowest z of the solid, mm.

        Returns
        -------
        netgen.occ.TopoDS_Shape
            The solid.
        """
        from netgen.occ import Segment

        low, high = self.arc.at(self.arc.ends)[0]
        roof = self.roof.at(np.linspace(0.0, 1.0, SAMPLES))[0]
        ring = [*roof[roof[:, 0] > high[0] * (1 + 1 / SAMPLES)][::-1], high]
        return self._revolved(x, y, below, [Segment(_point(low), _point(self.rim)), _curve(ring)])

    def _revolved(self, x: float, y: float, below: float, edges: list[Any]) -> Any:
        """Solid of revolution whose meridian consists of the given edges, from the lower to the upper border of the
        fillet."""
        from netgen.occ import Axis, Face, Pnt, Segment, Vec, Wire, Z

        low, high = self.arc.at(self.arc.ends)[0]
        roof, foot = self._roof_points(), self.side.at(np.ones(1))[0][0]
        bottom = foot + (foot - self.rim) * (foot[1] - below) / (self.rim[1] - foot[1])
        corners = [_point(roof[0]), Pnt(0, 0, float(bottom[1])), _point(bottom), _point(low)]
        straight = [Segment(*ends) for ends in zip(corners, corners[1:], strict=False)]
        half = Face(Wire([*straight, *edges, _curve([high, *roof[::-1]])]))
        solid = half.Revolve(Axis(Pnt(0, 0, 0), Z), 360)
        for face in solid.faces:
            ends, slack = face.bounding_box, 0.01 * self.arc.radius
            is_fillet = ends[0].z > low[1] - slack
            face.name = "roof" if ends[1].x < high[0] + slack else "fillet" if is_fillet else "side"
        return solid.Move(Vec(x, y, 0))

    def _roof_points(self) -> np.ndarray:
        """Points (M, 2) in mm along the roof's meridian, from the crown up to the fillet, without the last point."""
        points = self.roof.at(np.linspace(0.0, 1.0, SAMPLES))[0]
        points[0, 0] = 0.0
        return points[points[:, 0] < self.arc.at(self.arc.ends[1:])[0][0, 0] * (1 - 1 / SAMPLES)]

    def _towards_roof(self, in_plane: np.ndarray) -> np.ndarray:
        """Mask (N,) of the points (N, 2) on the roof's side of the ray from the fillet's centre to the sharp rim."""
        to_rim = self.rim - self.arc.centre
        return _cross(np.broadcast_to(to_rim, in_plane.shape), in_plane - self.arc.centre) >= 0


def rim_fillet(name: str, roof: Meridian, side: Meridian, radius: float) -> RimFillet:
    """Create the rounded edge between roof and side of a round cell.

    Parameters
    ----------
    name : str
        Name of the shape of the cells.
    roof, side : Meridian
        The meridian from the crown to the rim, and from the rim to the board.
    radius : float
        Radius of the fillet, mm.

    Returns
    -------
    RimFillet
        The fillet, in mm.

    Raises
    ------
    InputError
        if roof and side meet smoothly, or the fillet is too small or does not fit.
    """
    if rim_angle(side, roof) <= SMOOTH_RIM:
        raise InputError(
            f"fillet = {radius:g} is not allowed: the roof of these {name} cells joins the side smoothly, 0 is needed."
        )
    mouth = float(side.at(np.ones(1))[0][0, 0])
    arc = _touching_arc(roof, side, radius) if radius >= LEAST * 2 * mouth else None
    if arc is None:
        low, high = 0.0, mouth
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if _touching_arc(roof, side, middle) is None else (middle, high)
        raise refused(radius, 2 * mouth, low)
    return RimFillet(roof, side, arc)


def _touching_arc(roof: Meridian, side: Meridian, radius: float) -> Arc | None:
    """The arc of a radius that touches the roof and the side from inside; None if it does not fit."""
    from scipy.optimize import brentq

    rim, tangent, _ = (values[0] for values in side.at(np.zeros(1)))
    along = tangent / np.linalg.norm(tangent)
    inwards = np.array([along[1], -along[0]])

    def centre(u: float) -> np.ndarray:
        position, direction, _ = (values[0] for values in roof.at(np.array([u])))
        return position + radius * np.array([direction[1], -direction[0]]) / np.linalg.norm(direction)

    def gap(u: float) -> float:
        return float((centre(u) - rim) @ inwards) - radius

    if gap(1.0 - MOST) <= 0:
        return None
    u = brentq(gap, 1.0 - MOST, 1.0, xtol=1e-15, rtol=1e-14)
    at = centre(u)
    if (at - rim) @ along > MOST * np.linalg.norm(side.at(np.ones(1))[0][0] - rim):
        return None
    on_roof = roof.at(np.array([u]))[0][0] - at
    return Arc(at, radius, np.arctan2([-inwards[1], on_roof[1]], [-inwards[0], on_roof[0]]))


def _in_plane(points: np.ndarray) -> np.ndarray:
    """Coordinates r and z (N, 2) of points (N, 3)."""
    return np.column_stack([from_axis(False, points)[0], points[:, 2]])


def _point(point: np.ndarray) -> Any:
    from netgen.occ import Pnt

    return Pnt(float(point[0]), 0.0, float(point[1]))


def _curve(points: list[np.ndarray]) -> Any:
    """Curve through points (r, z) of a meridian, for the solid: straight if they have the same height, else a spline.
    """
    from netgen.occ import Segment, SplineInterpolation

    if np.ptp([point[1] for point in points]) < 1e-12:
        return Segment(_point(points[0]), _point(points[-1]))
    return SplineInterpolation([_point(point) for point in points])


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
