"""Exact round walls of a pad's cells, which elements only approximate by parabolas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.pads.regions import REGIONS


def onto_round_walls(
    pad: Pad, points: np.ndarray, region: np.ndarray, cell: np.ndarray, beside: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Project points of roofs and sides onto the nearest point of the round wall that they belong to.

    Those of leaning cells are projected as if these were upright.

    Parameters
    ----------
    pad : Pad
        With the walls, mm.
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
    axis = np.zeros_like(points)
    axis[:, :2] = np.array([(0.0, 0.0), *pad.cell_centres])[cell]
    shape = pad.shape
    for name in shape.round_regions:
        here = (region == REGIONS[name]) & (cell > 0)
        near = None if beside is None else beside[here]
        places[here], gradient[here] = shape.onto_wall(name, points[here], axis[here], near)
    return places, gradient
