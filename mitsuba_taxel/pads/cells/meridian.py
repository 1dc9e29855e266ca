"""Meridians of cells: curves (r, z), of which roofs are splines and sides straight, and surfaces that have them.

The roof's meridian is a B-spline in (r^2, z): every such curve that ends on the axis is smooth there, and planes,
spheres, ellipsoids and paraboloids are splines exactly. It is clamped, of degree 3 (or less, with fewer points), with
evenly spaced knots.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.point_tree import PointTree

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

DEGREE = 3
SAMPLES = 257
"""Points of a meridian at which its shape is checked, and near which projections are searched."""
TINY = 1e-9
"""Distance from the axis, relative to the radius, that counts as none."""
PLACES = 33
"""Points of a roof at which its tangents and bends are looked at."""
SIDES = (1, -1)
"""Of a cell, that to which it leans first."""
FLAT = 50.0
"""Radius of curvature, relative to the size of a cell, that stands for flat."""


@dataclass(frozen=True, eq=False)
class Meridian:
    """A curve (r, z) in mm over u from 0 to 1, and its continuation.

    Attributes
    ----------
    square, height : Callable
        r^2 and z as scipy's piecewise polynomials of s.
    power : int
        s is u to the power of 2 from the axis, where r is then smooth in u, else of 1.
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
            (r, z) in mm, and the first and second derivatives by u.
        """
        u = np.maximum(u, TINY) if self.power == 2 else u
        s, by, again = (u**2, 2 * u, 2.0) if self.power == 2 else (u, np.ones_like(u), 0.0)
        squares, heights = ([part(s, order) for order in range(3)] for part in (self.square, self.height))
        (q, dq, ddq), (z, dz, ddz) = (
            (value, rate * by, second * by**2 + rate * again) for value, rate, second in (squares, heights)
        )
        r = np.sqrt(q)
        dr = dq / (2 * r)
        return np.stack([r, z], 1), np.stack([dr, dz], 1), np.stack([(0.5 * ddq - dr**2) / r, ddz], 1)

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nearest points of the curve, by Newton's method from the nearest of `SAMPLES` points.

        Parameters
        ----------
        points : (N, 2) ndarray
            (r, z) in mm.

        Returns
        -------
        u : (N,) ndarray
            Parameter of the nearest point.
        gradient : (N, 2, 2) ndarray
            Derivative of that point by the given one.
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
        _, (along, curved) = self._newton(u, points)
        return u, along[:, :, None] * along[:, None, :] / curved[:, None, None]

    def along(self, rays: np.ndarray) -> np.ndarray:
        """Where rays from the origin, around which the curve turns, meet it.

        Parameters
        ----------
        rays : (N, 2) ndarray
            Directions (r, z), of any length.

        Returns
        -------
        (N,) ndarray
            The parameter u of each meeting, from 0 to 1.
        """
        samples = np.linspace(0, 1, SAMPLES)
        angles = np.arctan2(*self.at(samples)[0].T)
        u = np.interp(np.arctan2(*rays.T), angles, samples)
        for _ in range(5):
            place, rate, _ = self.at(u)
            off, slope = (rays[:, 0] * each[:, 1] - rays[:, 1] * each[:, 0] for each in (place, rate))
            u = u - off / slope
        return np.clip(u, 0.0, 1.0)

    def _newton(self, u: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        place, along, bend = self.at(u)
        off = place - points
        squared = (along**2).sum(axis=1)
        curved = np.maximum(squared + (off * bend).sum(axis=1), 0.25 * squared)
        return (off * along).sum(axis=1) / curved, (along, curved)


def control_points(text: str) -> np.ndarray:
    """(n, 2) r and z of the points of a profile, relative to the radius at the board and the height of the cell."""
    return np.array([row.split() for row in text.split(";")], dtype=float)


def as_text(points: np.ndarray) -> str:
    """The reverse of :func:`control_points`."""
    return "; ".join(f"{r:.16g} {z:.16g}" for r, z in points.tolist())


@kept(64)
def roof_meridian(text: str, radius: float, height: float) -> Meridian:
    """The spline of a roof, from the crown to the rim, in mm.

    Parameters
    ----------
    text : str
        Control points 'r z', separated by ';', from the rim to the crown.
    radius, height : float
        By which r and z are multiplied, mm.

    Returns
    -------
    Meridian
        In mm, from the crown at u = 0 to the rim.
    """
    from scipy.interpolate import PPoly

    r, z = control_points(text)[::-1].T
    degree, knots = _knots(len(r))
    square, heights = (PPoly.from_spline((knots, c, degree)) for c in ((radius * r) ** 2, height * z))
    first = degree  # of the polynomials of `from_spline`, those before the first knot are empty
    square, heights = (PPoly(part.c[:, first:-first], part.x[first:-first]) for part in (square, heights))
    square.c[-1, 0] = 0.0
    return Meridian(square, heights, 2)


def flat_meridian(radius: float, height: float) -> Meridian:
    """A flat roof, from the crown to its rim.

    Parameters
    ----------
    radius, height : float
        r and z of the rim, mm.

    Returns
    -------
    Meridian
        In mm.
    """
    from scipy.interpolate import PPoly

    return Meridian(PPoly([[radius**2], [0.0]], [0, 1]), PPoly([[0.0], [height]], [0, 1]), 2)


def side_meridian(rim: np.ndarray, radius: float) -> Meridian:
    """The straight side from the ``rim`` (2,) of a roof to the board, where it is ``radius`` mm from the axis."""
    from scipy.interpolate import PPoly

    r, z = rim
    wider = radius - r
    return Meridian(PPoly([[wider**2], [2 * r * wider], [r**2]], [0, 1]), PPoly([[-z], [z]], [0, 1]), 1)


def rim_angle(side: Meridian, roof: Meridian) -> float:
    """Degrees by which the meridian turns inwards from the side to the roof."""
    (a, b), (c, d) = (-curve.at(end)[1][0] for curve, end in ((side, np.zeros(1)), (roof, np.ones(1))))
    return math.degrees(math.atan2(a * d - b * c, a * c + b * d))


def leaning(along: np.ndarray, slope: float) -> np.ndarray:
    """Tangents (N, 2) of a meridian in a plane in which its cell leans outwards by ``slope`` mm per mm of height."""
    return along + along[:, 1:] * [slope, 0.0]


def least_radii(curve: Meridian, slope: float, size: float) -> np.ndarray:
    """(`PLACES`,) radii of curvature along a meridian of a cell of some size, in mm.

    Of leaning cells, the least of those across and along the plane in which they lean by ``slope`` mm per mm of height.
    """
    _, along, bend = curve.at(np.linspace(0, 1, PLACES))
    turn = along[:, 0] * bend[:, 1] - along[:, 1] * bend[:, 0]  # the same on all sides, as a shear keeps areas
    length = np.min([np.linalg.norm(leaning(along, side * slope), axis=1) for side in (0, *SIDES)], axis=0)
    return 1 / np.hypot(turn / length**3, 1 / (FLAT * size))


def from_axis(square: bool, points: np.ndarray, beside: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """(N,) distance of points (N, 2 or 3) from an axis along z, and its derivative (N, 2) by x and y.

    That to a side of a square section is the larger of x and y, or the one that is larger ``beside`` (N, 2 or 3).
    """
    x = points[:, :2]
    if not square:
        distance = np.maximum(np.linalg.norm(x, axis=1), TINY)
        return distance, x / distance[:, None]
    axis = np.abs(x if beside is None else beside[:, :2]).argmax(axis=1)
    here = np.arange(len(x)), axis
    out = np.zeros_like(x)
    out[here] = np.where(x[here] < 0, -1.0, 1.0)
    return np.maximum(np.abs(x[here]), TINY), out


def onto_meridian(
    curve: Meridian, points: np.ndarray, square: bool = False, beside: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3), relative to an axis along z, put onto the surface of a round or square section at the nearest
    place of its meridian, and the derivatives (N, 3, 3) by them; ``beside`` is as for :func:`from_axis`."""
    distance, out = from_axis(square, points, beside)
    u, inside = curve.nearest(np.column_stack([distance, points[:, 2]]))
    place = curve.at(u)[0]
    stretch = (place[:, 0] / distance)[:, None]
    gradient = np.zeros((len(points), 3, 3))
    along = points[:, :2] / distance[:, None]
    radial = along[:, :, None] * out[:, None, :]
    gradient[:, :2, :2] = inside[:, :1, :1] * radial + stretch[:, :, None] * (np.eye(2) - radial)
    gradient[:, :2, 2], gradient[:, 2, :2] = inside[:, :1, 1] * along, inside[:, 1:, 0] * out
    gradient[:, 2, 2] = inside[:, 1, 1]
    return np.column_stack([stretch * points[:, :2], place[:, 1]]), gradient


def _knots(count: int) -> tuple[int, np.ndarray]:
    degree = min(DEGREE, count - 1)
    return degree, np.concatenate([np.zeros(degree), np.linspace(0, 1, count - degree + 1), np.ones(degree)])


def of_quadric(rim: float, slope: float, count: int) -> np.ndarray:
    """(count, 2) points of the profile with r^2 = ``slope`` s + (1 - ``slope``) s^2 where z falls from 1 to ``rim`` as
    s rises from 0 to 1: a plane, or a part of a sphere."""
    from scipy.interpolate import BSpline

    degree, knots = _knots(count)
    greville = np.array([knots[k + 1 : k + 1 + degree].mean() for k in range(count)])
    square = slope * greville + (1 - slope) * greville**2
    control = np.linalg.solve(BSpline.design_matrix(greville, knots, degree).toarray(), square)
    return np.stack([np.sqrt(np.clip(control, 0.0, 1.0)), 1 - (1 - rim) * greville], axis=1)[::-1]
