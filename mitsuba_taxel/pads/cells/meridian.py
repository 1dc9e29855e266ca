"""Meridians of cells: curves (r, z). Roofs are splines, sides are straight.

The roof's meridian is a B-spline in (r^2, z): every such curve that ends on the axis is smooth there, and planes,
spheres, ellipsoids and paraboloids are represented exactly. The spline is clamped, with evenly spaced knots, of degree
3 (or less, with fewer points)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.point_tree import PointTree

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

    from mitsuba_taxel.pads.cells.arc import Arc

DEGREE = 3
SAMPLES = 257
"""Number of points of a meridian at which its shape is checked, and from which projections start."""
TINY = 1e-9
"""Distance from the axis, relative to the radius, that counts as zero."""
PLACES = 33
"""Number of points of a roof at which tangents and curvature are evaluated."""
SIDES = (1, -1)
"""Signs of the two sides of a leaning cell; first the side to which it leans."""
SMOOTH_RIM = 10.0
"""Largest angle in degrees between side and roof at a smooth rim."""
FLAT = 50.0
"""Largest radius of curvature, relative to the size of a cell: the value for flat walls."""


@dataclass(frozen=True, eq=False)
class Meridian:
    """A meridian: the outline (r, z) of a cell in mm, as a function of the parameter u from 0 to 1. It can be evaluated
    beyond its ends.

    Attributes
    ----------
    square, height : Callable
        r^2 and z as scipy's piecewise polynomials of s.
    power : int
        Exponent in s = u^power: 2 if the curve begins on the axis, so that r is smooth in u there; otherwise 1.
    """

    square: PPoly
    height: PPoly
    power: int

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points of the curve and their derivatives.

        Parameters
        ----------
        u : (N,) ndarray
            Parameter along the curve.

        Returns
        -------
        points, first, second : (N, 2) ndarray
            (r, z) in mm, and the first and second derivatives with respect to u.
        """
        u = np.maximum(u, TINY) if self.power == 2 else u
        # r^2 and z are polynomials of s: their derivatives with respect to u follow by the chain rule.
        s, ds, dds = (u**2, 2 * u, 2.0) if self.power == 2 else (u, np.ones_like(u), 0.0)
        squares, heights = ([polynomial(s, order) for order in range(3)] for polynomial in (self.square, self.height))
        (q, dq, ddq), (z, dz, ddz) = (
            (value, rate * ds, second * ds**2 + rate * dds) for value, rate, second in (squares, heights)
        )
        r = np.sqrt(q)
        dr = dq / (2 * r)
        return np.stack([r, z], 1), np.stack([dr, dz], 1), np.stack([(0.5 * ddq - dr**2) / r, ddz], 1)

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The points of the meridian nearest to given points, by Newton's method from the nearest of `SAMPLES` points.

        Parameters
        ----------
        points : (N, 2) ndarray
            (r, z) in mm.

        Returns
        -------
        u : (N,) ndarray
            Parameter of the nearest point.
        gradient : (N, 2, 2) ndarray
            Derivative of the nearest point with respect to the point.
        """
        samples = np.linspace(0, 1, SAMPLES)
        u = samples[PointTree(self.at(samples)[0]).query(points)[1]]
        for _ in range(20):
            step, _ = self._newton(u, points)
            u = u - step
            if self.power == 2:
                u = np.maximum(u, 0.0)
            if np.abs(step).max(initial=0.0) < 1e-14:
                break
        _, (tangent, hessian) = self._newton(u, points)
        return u, tangent[:, :, None] * tangent[:, None, :] / hessian[:, None, None]

    def along(self, rays: np.ndarray) -> np.ndarray:
        """Intersections of the meridian with rays from the origin, which lies on its concave side, by Newton's method.

        Parameters
        ----------
        rays : (N, 2) ndarray
            Directions (r, z), of any length.

        Returns
        -------
        (N,) ndarray
            The parameter u of each intersection, from 0 to 1.
        """
        samples = np.linspace(0, 1, SAMPLES)
        angles = np.arctan2(*self.at(samples)[0].T)
        u = np.interp(np.arctan2(*rays.T), angles, samples)
        for _ in range(5):
            position, tangent, _ = self.at(u)
            residual, slope = (rays[:, 0] * vector[:, 1] - rays[:, 1] * vector[:, 0] for vector in (position, tangent))
            u = u - residual / slope
        return np.clip(u, 0.0, 1.0)

    def _newton(self, u: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """One step of Newton's method: changes the parameters u so that the points of the curve come nearer to given
        points. Returns the step, and the tangent and the second derivative of half the squared distance.

        The second derivative is bounded from below, so that the step always reduces the distance.
        """
        position, tangent, second = self.at(u)
        distance = position - points
        squared_speed = (tangent**2).sum(axis=1)
        hessian = np.maximum(squared_speed + (distance * second).sum(axis=1), 0.25 * squared_speed)
        return (distance * tangent).sum(axis=1) / hessian, (tangent, hessian)


def control_points(text: str) -> np.ndarray:
    """Coordinates (n, 2) of the n control points of a profile: r relative to the radius at the board, z relative to the
    height of the cell."""
    return np.array([row.split() for row in text.split(";")], dtype=float)


def as_text(points: np.ndarray) -> str:
    """Write control points (n, 2) as text, from which :func:`control_points` restores them."""
    return "; ".join(f"{r:.16g} {z:.16g}" for r, z in points.tolist())


@kept(64)
def roof_meridian(text: str, radius: float, height: float) -> Meridian:
    """The meridian of a smooth roof as a spline, from its highest point (crown) to the rim, in mm.

    Parameters
    ----------
    text : str
        Control points 'r z', separated by ';', from the rim to the crown.
    radius, height : float
        Factors of r and z, mm.

    Returns
    -------
    Meridian
        Curve in mm, from the crown at u = 0 to the rim at u = 1.
    """
    from scipy.interpolate import PPoly

    r, z = control_points(text)[::-1].T
    degree, knots = _knots(len(r))
    splines = (PPoly.from_spline((knots, c, degree)) for c in ((radius * r) ** 2, height * z))
    # The knots at the ends are repeated, which gives empty intervals, as many as the degree: they are cut off.
    square, heights = (PPoly(spline.c[:, degree:-degree], spline.x[degree:-degree]) for spline in splines)
    square.c[-1, 0] = 0.0
    return Meridian(square, heights, 2)


def flat_meridian(radius: float, height: float) -> Meridian:
    """The meridian of a flat roof, from the axis to its rim.

    Parameters
    ----------
    radius, height : float
        r and z of the rim, mm.

    Returns
    -------
    Meridian
        Meridian in mm.
    """
    from scipy.interpolate import PPoly

    return Meridian(PPoly([[radius**2], [0.0]], [0, 1]), PPoly([[0.0], [height]], [0, 1]), 2)


def side_meridian(rim: np.ndarray, radius: float) -> Meridian:
    """The meridian of a straight side wall.

    Parameters
    ----------
    rim : (2,) ndarray
        r and z of the rim of the roof, mm.
    radius : float
        r at the board, mm.

    Returns
    -------
    Meridian
        Curve in mm, from the rim at u = 0 to the board at u = 1.
    """
    from scipy.interpolate import PPoly

    r, z = rim
    widening = radius - r
    return Meridian(PPoly([[widening**2], [2 * r * widening], [r**2]], [0, 1]), PPoly([[-z], [z]], [0, 1]), 1)


def rim_angle(side: Meridian, roof: Meridian) -> float:
    """Angle at the rim between side and roof.

    Parameters
    ----------
    side, roof : Meridian
        The two curves that meet at the rim.

    Returns
    -------
    float
        Degrees by which the meridian turns inwards from the side to the roof; 0 if they join smoothly.
    """
    (a, b), (c, d) = (-curve.at(u)[1][0] for curve, u in ((side, np.zeros(1)), (roof, np.ones(1))))
    return math.degrees(math.atan2(a * d - b * c, a * c + b * d))


def leaning(tangents: np.ndarray, slope: float) -> np.ndarray:
    """Tangents of a meridian after the shear of a leaning cell.

    Parameters
    ----------
    tangents : (N, 2) ndarray
        Tangents of the upright cell, in the plane in which it leans.
    slope : float
        Outward shift per height.

    Returns
    -------
    (N, 2) ndarray
        Tangents of the leaning cell.
    """
    return tangents + tangents[:, 1:] * [slope, 0.0]


def least_radii(curve: Meridian, slope: float, size: float) -> np.ndarray:
    """Smallest radii of curvature of a leaning cell along its meridian: the shear of the lean is included.

    Parameters
    ----------
    curve : Meridian
        Curve of the upright cell.
    slope : float
        Shift per height in the plane in which the cell leans.
    size : float
        Size of the cell, mm; radii are limited to `FLAT` times it.

    Returns
    -------
    (`PLACES`,) ndarray
        Radii in mm, at points from one end to the other: the smaller of the radii across and along the plane of
        leaning.
    """
    _, tangent, second = curve.at(np.linspace(0, 1, PLACES))
    cross = tangent[:, 0] * second[:, 1] - tangent[:, 1] * second[:, 0]  # the same on all sides, as a shear keeps areas
    length = np.min([np.linalg.norm(leaning(tangent, side * slope), axis=1) for side in (0, *SIDES)], axis=0)
    return 1 / np.hypot(cross / length**3, 1 / (FLAT * size))


def from_axis(square: bool, points: np.ndarray, beside: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Distance of points from an axis along z.

    Parameters
    ----------
    square : bool
        Whether the section is square: then the distance is the larger of ``|x|`` and ``|y|``.
    points : (N, 2 or 3) ndarray
        Points relative to the axis, mm.
    beside : (N, 2 or 3) ndarray, optional
        Points that replace ``points`` in the decision whether x or y is used for a square section.

    Returns
    -------
    distance : (N,) ndarray
        Distances in mm, at least `TINY`.
    gradient : (N, 2) ndarray
        Derivative of the distance with respect to x and y.
    """
    x = points[:, :2]
    if not square:
        distance = np.maximum(np.linalg.norm(x, axis=1), TINY)
        return distance, x / distance[:, None]
    axis = np.abs(x if beside is None else beside[:, :2]).argmax(axis=1)
    selected = np.arange(len(x)), axis
    gradient = np.zeros_like(x)
    gradient[selected] = np.where(x[selected] < 0, -1.0, 1.0)
    return np.maximum(np.abs(x[selected]), TINY), gradient


def onto_meridian(
    curve: Meridian | Arc, points: np.ndarray, square: bool = False, beside: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Project points onto the wall that a meridian describes.

    Parameters
    ----------
    curve : Meridian or Arc
        Curve of the wall.
    points : (N, 3) ndarray
        Points relative to the axis, mm.
    square : bool
        Whether the section is square, else it is round.
    beside : (N, 3) ndarray, optional
        Points that replace ``points`` in the decision whether x or y is used for a square section. See
        :func:`from_axis`.

    Returns
    -------
    projected : (N, 3) ndarray
        Nearest positions on the wall, mm.
    gradient : (N, 3, 3) ndarray
        Their derivatives with respect to the points.
    """
    # Project in the plane of the meridian, and scale x and y by the change of the distance from the axis.
    distance, distance_rate = from_axis(square, points, beside)
    u, in_plane = curve.nearest(np.column_stack([distance, points[:, 2]]))
    position = curve.at(u)[0]
    scale = (position[:, 0] / distance)[:, None]
    # The chain rule, with the derivatives of the projection in the plane (N, 2, 2) and of the distance (N, 2).
    gradient = np.zeros((len(points), 3, 3))
    direction = points[:, :2] / distance[:, None]
    radial = direction[:, :, None] * distance_rate[:, None, :]
    gradient[:, :2, :2] = in_plane[:, :1, :1] * radial + scale[:, :, None] * (np.eye(2) - radial)
    gradient[:, :2, 2], gradient[:, 2, :2] = in_plane[:, :1, 1] * direction, in_plane[:, 1:, 0] * distance_rate
    gradient[:, 2, 2] = in_plane[:, 1, 1]
    return np.column_stack([scale * points[:, :2], position[:, 1]]), gradient


def _knots(count: int) -> tuple[int, np.ndarray]:
    degree = min(DEGREE, count - 1)
    return degree, np.concatenate([np.zeros(degree), np.linspace(0, 1, count - degree + 1), np.ones(degree)])


def of_quadric(rim: float, slope: float, count: int) -> np.ndarray:
    """Control points (r, z) of a plane, or of part of a sphere, as the roof of a profile cell.

    Parameters
    ----------
    rim : float
        z of the rim, relative to the crown.
    slope : float
        The profile is r^2 = ``slope`` s + (1 - ``slope``) s^2, while z falls from 1 to ``rim`` as s rises from 0 to 1.
    count : int
        Number of control points.

    Returns
    -------
    (count, 2) ndarray
        r and z, relative to the radius and the height of the cell, from the rim to the crown.
    """
    from scipy.interpolate import BSpline

    degree, knots = _knots(count)
    greville = np.array([knots[k + 1 : k + 1 + degree].mean() for k in range(count)])
    square = slope * greville + (1 - slope) * greville**2
    control = np.linalg.solve(BSpline.design_matrix(greville, knots, degree).toarray(), square)
    return np.stack([np.sqrt(np.clip(control, 0.0, 1.0)), 1 - (1 - rim) * greville], axis=1)[::-1]
