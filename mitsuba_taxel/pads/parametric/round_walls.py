"""Exact curved walls of a pad's cells, which elements approximate by parabolas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.pads.regions import REGIONS


def onto_round_walls(
    pad: Pad, points: np.ndarray, region: np.ndarray, cell: np.ndarray, beside: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Project points of roofs and sides onto the curved wall that they belong to.

    The projection is to the nearest point of the wall of the upright cell; leaning cells are sheared back for it.

    Parameters
    ----------
    pad : Pad
        Pad with the walls, mm.
    points : (N, 3) ndarray
        Undeformed positions near the walls, mm.
    region, cell : (N,) ndarray
        Code of the region and number of the cell of each point.
    beside : (N, 3) ndarray, optional
        For each point, a neighbour on the same wall: it decides for points on the edges of a square section.

    Returns
    -------
    projected : (N, 3) ndarray
        Projected points in mm; points of flat walls and of other regions are unchanged.
    gradient : (N, 3, 3) ndarray
        Derivative of each projected point with respect to the point.
    """
    if pad.top_x or pad.top_y:
        shear = np.eye(3)
        shear[:2, 2] = pad.slope
        upright = replace(pad, top_x=0.0, top_y=0.0)
        upright_map = np.linalg.inv(shear)
        wall_beside = None if beside is None else beside @ upright_map.T
        projected, gradient = onto_round_walls(upright, points @ upright_map.T, region, cell, wall_beside)
        return projected @ shear.T, shear @ gradient @ upright_map
    projected, gradient = points.copy(), np.tile(np.eye(3), (len(points), 1, 1))
    axis = np.zeros_like(points)
    axis[:, :2] = np.array([(0.0, 0.0), *pad.cell_centres])[cell]
    shape, edges, mouth = pad.shape, pad.edges, pad.mouth
    in_mouth = np.zeros(len(points), dtype=bool)
    if mouth is not None:
        in_mouth = (region == REGIONS["side"]) & (cell > 0) & (points[:, 2] < mouth.height)
        on_arc, gradient[in_mouth] = mouth.onto_arc(points[in_mouth] - axis[in_mouth])
        projected[in_mouth] = axis[in_mouth] + on_arc
    for name in pad.curved_regions if edges is not None else shape.round_regions:
        selected = (region == REGIONS[name]) & (cell > 0) & ~in_mouth
        if edges is not None:
            on_wall, gradient[selected] = edges.onto_wall(points[selected] - axis[selected])
            projected[selected] = axis[selected] + on_wall
            continue
        wall_beside = None if beside is None else beside[selected]
        projected[selected], gradient[selected] = shape.onto_wall(name, points[selected], axis[selected], wall_beside)
    return projected, gradient
