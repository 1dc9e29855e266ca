"""How diffuse walls pass light on: from a point into the hemisphere before it, and onto a surface.

All integrals are over surfaces. With d from a point x to a point y of a surface, r = |d|, and the area normal N of the
surface (its length is area per unit of what is integrated over), light that leaves x evenly over solid angles falls
there with -(N . d) / (2 pi r^3), and by Lambert's law with (n . d) (-N . d) / (pi r^4), n being the unit normal at x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Exchange:
    """What leaves points x and falls on a surface at points y, of N pairs.

    Attributes
    ----------
    value : (N,) ndarray
        Per unit of power and of what the surface is integrated over.
    by_start, by_normal, by_end, by_area : (3, N) ndarray or None
        Its derivatives by x, n, y and N, where these are wanted.
    """

    value: np.ndarray
    by_start: np.ndarray | None = None
    by_normal: np.ndarray | None = None
    by_end: np.ndarray | None = None
    by_area: np.ndarray | None = None


def exchange(
    start: np.ndarray,
    normal: np.ndarray,
    end: np.ndarray,
    area: np.ndarray,
    isotropic: np.ndarray,
    lambertian: np.ndarray,
    with_slopes: bool,
) -> Exchange:
    """What walls that scatter so much isotropically and by Lambert's law, (N,) each, pass on; vectors are (3, N)."""
    d = end - start
    squared = _dot(d, d)
    facing, leaving = -_dot(area, d), _dot(normal, d)
    seen = (facing > 0) & (leaving > 0)
    over = np.where(seen, 1 / np.maximum(squared, np.finfo(float).tiny), 0.0)
    even = isotropic / (2 * math.pi) * over * np.sqrt(over)
    cosine = lambertian / math.pi * over * over
    per_facing = even + cosine * leaving
    value = per_facing * facing
    if not with_slopes:
        return Exchange(value)
    per_leaving = cosine * facing
    radial = -(3 * even + 4 * cosine * leaving) * facing * over
    by_end = radial * d - per_facing * area + per_leaving * normal
    return Exchange(value, -by_end, per_leaving * d, by_end, -per_facing * d)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
