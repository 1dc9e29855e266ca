"""Rays between points of dies under clear resin and points in the air above their windows."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.parts.part import Side

POINTS = 2**13
"""Points of the quadrature over dies: curves are accurate to about 0.2 %."""
ANGLES = 4000
"""Tabulated angles, between which the angle of a ray is interpolated; as many as rays if there are fewer."""


def refracted(index: float, height: float, depths: float, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles of rays through air and resin between points at given lateral distances.

    Parameters
    ----------
    index : float
        Refractive index of the resin.
    height, depths : float
        Lengths of the path along z in air and in resin, mm.
    distance : (N,) ndarray
        Lateral distances R in mm.

    Returns
    -------
    angle, geometry : (N,) ndarray
        The angle t in air, and 1 / (2 R) d(sin^2 t)/dR in 1/mm2: the projected solid angle in air per area at the end
        of the ray.
    """
    angle, sine, cosine = _tabulated_angles(min(ANGLES, len(distance)))
    resin_cosine = np.sqrt(index**2 - sine**2)
    lateral = height * sine / cosine + depths * sine / resin_cosine
    rate = height / cosine**2 + depths * cosine * index**2 / resin_cosine**3
    return np.interp(distance, lateral, angle), np.interp(distance, lateral, sine * cosine / rate / lateral)


@kept(4)
def _tabulated_angles(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles between 0 and 90 degrees, and their sines and cosines, read-only."""
    angle = np.linspace(0, np.pi / 2, count + 2)[1:-1]
    table = np.stack([angle, np.sin(angle), np.cos(angle)])
    table.flags.writeable = False
    return table[0], table[1], table[2]


def transmittance(index: float, cosine: np.ndarray) -> np.ndarray:
    """Fresnel's transmittance of the resin's surface for unpolarised light; ``cosine`` is that of the angle in air."""
    cosine_in_resin = np.sqrt(1 - (1 - cosine**2) / index**2)
    perpendicular = (cosine - index * cosine_in_resin) / (cosine + index * cosine_in_resin)
    parallel = (index * cosine - cosine_in_resin) / (index * cosine + cosine_in_resin)
    return 1 - (perpendicular**2 + parallel**2) / 2


def relative_radiance(emitter: Side, cosine: np.ndarray) -> np.ndarray:
    """Radiance of an emitter's die relative to that of a Lambertian die of the same power. ``cosine`` is that of the
    angle in air to the normal."""
    return 0.5 * (1 + (emitter.exponent or 1.0)) * emitter.relative_to_lambert(cosine)


@kept(4)
def sobol_points(dimensions: int, count: int = POINTS) -> np.ndarray:
    """Points of a Sobol' sequence around 0.

    Parameters
    ----------
    dimensions : int
        Number of coordinates of each point.
    count : int
        Number of points, a power of 2.

    Returns
    -------
    (count, dimensions) ndarray
        Coordinates from -1/2 to 1/2, read-only.
    """
    from scipy.stats import qmc

    points = qmc.Sobol(dimensions, seed=np.random.default_rng(0)).random(count) - 0.5
    points.flags.writeable = False
    return points


def die_points(side: Side, uniform: np.ndarray) -> np.ndarray:
    """Convert numbers from -1/2 to 1/2, (N, 2), to points of a die, x and y in mm."""
    return np.array([side.x, side.y]) + uniform * [side.die_width, side.die_length]


def emitted_rays(side: Side, uniform: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays from a die whose directions in air follow Lambert's law.

    Parameters
    ----------
    side : Side
        The die.
    uniform : (N, 4) ndarray
        Numbers from -1/2 to 1/2: two for the point, two for the direction.

    Returns
    -------
    start, heading : (N, 2) ndarray
        Points of the die in mm, and unit vectors of the direction along the board.
    sine : (N,) ndarray
        Sine of the angle in air.
    """
    turn, sine = 2 * np.pi * uniform[:, 2], np.sqrt(uniform[:, 3] + 0.5)
    return die_points(side, uniform[:, :2]), np.stack([np.cos(turn), np.sin(turn)], axis=1), sine


def passes_window(side: Side, points: np.ndarray) -> np.ndarray:
    """Find which points lie in the window of a die.

    Parameters
    ----------
    side : Side
        The die with its window.
    points : (N, 2) ndarray
        Points in the plane of the window, mm.

    Returns
    -------
    (N,) ndarray of bool
        Whether each point lies in the window.
    """
    x, y = np.abs(points - side.window_centre).T
    half_width = side.window_width / 2
    if side.window_shape == "rectangle":
        return (x <= half_width) & (y <= side.window_length / 2)
    return np.hypot(x, np.maximum(y - (side.window_length / 2 - half_width), 0.0)) <= half_width
