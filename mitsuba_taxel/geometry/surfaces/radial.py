"""Radial projection of points onto spheres and cylinders."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.surfaces.triangles import unit


def put_radially(
    points: np.ndarray, centre: np.ndarray, radius: float, across: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Project points radially onto a sphere or cylinder.

    Parameters
    ----------
    points, centre : (N, 3) ndarray
        Points and centre, (N, 3) or (3,), mm.
    radius : float
        Radius of the sphere or cylinder, mm.
    across : (3, 3) ndarray
        Projection onto the directions of the radius: the identity for a sphere, the projection across the axis for a
        cylinder.

    Returns
    -------
    places : (N, 3) ndarray
        Projected points, mm.
    gradient : (N, 3, 3) ndarray
        Derivative of each projected point with respect to the point.
    """
    from_centre = (points - centre) @ across
    stretch = (radius / np.linalg.norm(from_centre, axis=1))[:, None]
    radial = unit(from_centre)
    flattened = across - radial[:, :, None] * radial[:, None, :]
    return points + (stretch - 1) * from_centre, np.eye(3) - across + stretch[:, :, None] * flattened
