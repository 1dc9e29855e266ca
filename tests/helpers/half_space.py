"""Displacements of an elastic half-space by pressures on the squares of a grid."""

from __future__ import annotations

import numpy as np


def half_space(x, y, side):
    """Displacement of a half-space of plane-strain modulus 1 at points (m,), per N on a square at each.

    A. E. H. Love, Phil. Trans. R. Soc. A 228 (1929), for a uniform pressure on a rectangle.
    """
    a, b = x[:, None] - x, y[:, None] - y

    def corner(u, v):
        return u * np.arcsinh(v / np.abs(u)) + v * np.arcsinh(u / np.abs(v))

    h = side / 2
    total = corner(a + h, b + h) - corner(a - h, b + h) - corner(a + h, b - h) + corner(a - h, b - h)
    return total / (np.pi * side**2)


def grid(count, side):
    """Centres x, y of the squares of a grid."""
    places = side * (np.arange(count) - (count - 1) / 2)
    return tuple(coordinate.ravel() for coordinate in np.meshgrid(places, places))
