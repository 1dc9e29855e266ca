"""Points put onto spheres and cylinders, along their radii."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.triangles import unit


def put_radially(
    points: np.ndarray, centre: np.ndarray, radius: float, across: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points moved onto the sphere or cylinder of a radius.

    Parameters
    ----------
    points, centre : (N, 3) ndarray
        And (N, 3) or (3,), mm.
    across : (3, 3) ndarray
        Projection onto the directions in which the radius is measured: the identity for a sphere.

    Returns
    -------
    places : (N, 3) ndarray
        Mm.
    gradient : (N, 3, 3) ndarray
        Derivative of a point's place by the point.
    """
    from_centre = (points - centre) @ across
    stretch = (radius / np.linalg.norm(from_centre, axis=1))[:, None]
    radial = unit(from_centre)
    flattened = across - radial[:, :, None] * radial[:, None, :]
    return points + (stretch - 1) * from_centre, np.eye(3) - across + stretch[:, :, None] * flattened
