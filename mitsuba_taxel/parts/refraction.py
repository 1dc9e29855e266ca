"""Rays between points of dies under clear resin and points in the air above their windows."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.parts.part import Side

POINTS = 2**13
"""Of the quadrature over dies: curves are accurate to about 0.2 %."""
ANGLES = 4000
"""Tabulated angles between which a ray's angle is interpolated."""


def refracted(index: float, height: float, depths: float, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays through air and resin between points at given lateral distances.

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
        The angle t in air, and 1 / (2 R) d(sin^2 t)/dR in 1/mm2: projected solid angle in air by area at the far end.
    """
    angle = np.linspace(0, np.pi / 2, ANGLES + 2)[1:-1]
    sine, cosine = np.sin(angle), np.cos(angle)
    beneath = np.sqrt(index**2 - sine**2)
    reach = height * sine / cosine + depths * sine / beneath
    rate = height / cosine**2 + depths * cosine * index**2 / beneath**3
    return np.interp(distance, reach, angle), np.interp(distance, reach, sine * cosine / rate / reach)


def transmittance(index: float, cosine: np.ndarray) -> np.ndarray:
    """Fresnel's, of unpolarised light, by the cosine of the angle in air."""
    within = np.sqrt(1 - (1 - cosine**2) / index**2)
    across = (cosine - index * within) / (cosine + index * within)
    along = (index * cosine - within) / (index * cosine + within)
    return 1 - (across**2 + along**2) / 2


def relative_radiance(emitter: Side, cosine: np.ndarray) -> np.ndarray:
    """Radiance of a die in a direction in air, relative to that of a Lambertian one of the same power."""
    return 0.5 * (1 + (emitter.exponent or 1.0)) * emitter.relative_to_lambert(cosine)


def sobol_points(dimensions: int) -> np.ndarray:
    """(N, dimensions) from -1/2 to 1/2, evenly distributed."""
    from scipy.stats import qmc

    return qmc.Sobol(dimensions, seed=np.random.default_rng(0)).random(POINTS) - 0.5


def die_points(side: Side, uniform: np.ndarray) -> np.ndarray:
    """(N, 2) x and y in mm of points of a die, from (N, 2) numbers from -1/2 to 1/2."""
    return np.array([side.x, side.y]) + uniform * [side.die_width, side.die_length]


def emitted_rays(side: Side, uniform: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays from a die that are distributed in air by Lambert's law, from (N, 4) numbers from -1/2 to 1/2.

    Returns
    -------
    start, heading : (N, 2) ndarray
        Points of the die in mm, and unit vectors along the board.
    sine : (N,) ndarray
        Of the angle in air.
    """
    turn, sine = 2 * np.pi * uniform[:, 2], np.sqrt(uniform[:, 3] + 0.5)
    return die_points(side, uniform[:, :2]), np.stack([np.cos(turn), np.sin(turn)], axis=1), sine


def passes_window(side: Side, places: np.ndarray) -> np.ndarray:
    """Whether places (N, 2) lie in a window."""
    x, y = np.abs(places - side.window_centre).T
    half = side.window_width / 2
    if side.window_shape == "rectangle":
        return (x <= half) & (y <= side.window_length / 2)
    return np.hypot(x, np.maximum(y - (side.window_length / 2 - half), 0.0)) <= half
