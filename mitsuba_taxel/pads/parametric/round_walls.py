"""Exact round walls of a pad's cells: spheres, cylinders and profiles, which elements only approximate by parabolas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.geometry.radial import put_radially
from mitsuba_taxel.pads.pad import PROFILE, REGIONS, Pad
from mitsuba_taxel.pads.profile import onto_meridian, roof_of, side_of


def is_round(pad: Pad, region: str) -> bool:
    """Whether the ``roof`` or ``side`` of cells is a sphere, a cylinder or given by a profile."""
    return (pad.dome_radius > 0 or pad.cell == PROFILE) if region == "roof" else pad.cell != "parallelepiped"


def onto_round_walls(
    pad: Pad, points: np.ndarray, region: np.ndarray, cell: np.ndarray, beside: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Project points of roofs and sides onto the nearest point of the sphere, cylinder or profile that they belong to.

    Those of leaning cells are projected as if these were upright.

    Parameters
    ----------
    points : (N, 3) ndarray
        In mm, undeformed, near the walls.
    region, cell : (N,) ndarray
        Code of the region and number of the cell of each.
    beside : (N, 3) ndarray, optional
        Points near by that tell which wall each of those is on that lie on the edges of cells of a square section.

    Returns
    -------
    places : (N, 3) ndarray
        In mm; points of flat walls and of other regions are unchanged.
    gradient : (N, 3, 3) ndarray
        Derivative of each projected point with respect to the point.
    """
    if pad.top_x or pad.top_y:
        shear = np.eye(3)
        shear[:2, 2] = pad.slope
        upright = replace(pad, top_x=0.0, top_y=0.0)
        back = np.linalg.inv(shear)
        near = None if beside is None else beside @ back.T
        places, gradient = onto_round_walls(upright, points @ back.T, region, cell, near)
        return places @ shear.T, shear @ gradient @ back
    places, gradient = points.copy(), np.tile(np.eye(3), (len(points), 1, 1))
    centre = np.zeros_like(points)
    centre[:, :2] = np.array([(0.0, 0.0), *pad.cell_centres])[cell]
    if pad.cell == PROFILE:
        for name, curve in (("roof", roof_of(pad)), ("side", side_of(pad))):
            here = (region == REGIONS[name]) & (cell > 0)
            near = None if beside is None else (beside - centre)[here]
            found, gradient[here] = onto_meridian(curve, points[here] - centre[here], pad.is_square, near)
            places[here] = centre[here] + found
        return places, gradient
    centre[:, 2] = pad.top_of_cell - pad.dome_radius
    walls = [("roof", pad.dome_radius, np.eye(3)), ("side", 0.5 * pad.cell_size, np.diag([1.0, 1.0, 0.0]))]
    for name, radius, across in walls:
        if not is_round(pad, name):
            continue
        here = (region == REGIONS[name]) & (cell > 0)
        places[here], gradient[here] = put_radially(points[here], centre[here], radius, across)
    return places, gradient
