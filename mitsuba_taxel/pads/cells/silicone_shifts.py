"""Displacements of the silicone between cells when the dimensions of a pad change.

The region of a cell is the silicone around it, up to the midplanes between neighbours and the outside of the pad.
Within it, displacements are interpolated linearly: between planes, or along rays through the wall of the cell to the
border of the region."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.pads.cells.cell_shape import Dimensions

BESIDE = 0.4
"""Largest thickness of the silicone beside a wall that scales with the fillets, relative to that between two cells."""


def axes(pad: Dimensions) -> list[np.ndarray]:
    """Positions of the axes of the cells, in mm: x of the columns, and y of the rows, both ascending."""
    return [(np.arange(count) - 0.5 * (count - 1)) * pad.pitch for count in (pad.columns, pad.rows)]


def region_planes(pad: Dimensions, levels: list[float]) -> list[np.ndarray]:
    """Planes that bound the regions of cells: outside of the pad, midplanes between cells, and horizontal planes.

    Parameters
    ----------
    pad : Dimensions
        The pad, with lengths in mm.
    levels : list[float]
        z of the horizontal planes, mm.

    Returns
    -------
    list[ndarray]
        x, y and z of the planes, ascending, mm.
    """
    midplanes = [0.5 * (axis[1:] + axis[:-1]) for axis in axes(pad)]
    return [*_enclosed(pad, midplanes), np.array(levels)]


def wall_planes(pad: Dimensions, roof: float) -> list[np.ndarray]:
    """Planes of the walls of cuboid cells: the outside of the pad, the walls, and horizontal planes.

    With fillets there are planes on both sides of each wall, at the distance of the radius: between them, changes of
    the radius scale the silicone and the fillets, which remain round.

    Parameters
    ----------
    pad : Dimensions
        The pad, with lengths in mm.
    roof : float
        Height of the roof, mm.

    Returns
    -------
    list[ndarray]
        x, y and z of the planes, ascending, mm.
    """
    outwards, above = [0.0], [0.0]
    if pad.fillet:
        gap = min(pad.pitch - pad.cell_size if pad.rows * pad.columns > 1 else np.inf, 2 * pad.wall)
        outwards = [-pad.fillet, 0.0, min(pad.fillet, BESIDE * gap)]
        above = [-pad.fillet, 0.0, min(pad.fillet, 2 * BESIDE * (pad.height - roof))]
    right = 0.5 * pad.cell_size + np.array(outwards)
    around = np.concatenate([-right[::-1], right])
    planes = [(axis[:, None] + around).ravel() for axis in axes(pad)]
    return [*_enclosed(pad, planes), np.array([0.0, *(roof + np.array(above)), pad.height])]


def _enclosed(pad: Dimensions, inner: list[np.ndarray]) -> list[np.ndarray]:
    return [np.array([-0.5 * width, *x, 0.5 * width]) for x, width in zip(inner, pad.extent, strict=False)]


def shifts_between_planes(points: np.ndarray, planes: list[np.ndarray], target_planes: list[np.ndarray]) -> np.ndarray:
    """Displacements of points that keep their relative position between planes that move.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    planes, target_planes : list[ndarray]
        x, y and z of the planes before and after, mm.

    Returns
    -------
    (N, 3) ndarray
        Displacements in mm.
    """
    axes_planes = zip(points.T, planes, target_planes, strict=True)
    return np.stack([np.interp(x, before, after - before) for x, before, after in axes_planes], axis=1)


@dataclass(frozen=True)
class Rays:
    """N rays, each from the axis of a cell through a point of the silicone around that cell.

    Attributes
    ----------
    origin, direction : (N, 3) ndarray
        Positions on the axis, mm, and unit vectors.
    length : (N,) ndarray
        Distance of the points from the origin, mm.
    outside : (N, 3) ndarray
        Displacements where the rays leave the region, mm.
    """

    origin: np.ndarray
    direction: np.ndarray
    length: np.ndarray
    outside: np.ndarray

    def at(self, distance: np.ndarray) -> np.ndarray:
        """Positions (N, 3) on the rays in mm, at distances (N,) from their origins."""
        return self.origin + distance[:, None] * self.direction


def shifts_along_rays(
    pad: Dimensions,
    target: Dimensions,
    planes: tuple[list[np.ndarray], list[np.ndarray]],
    points: np.ndarray,
    base: np.ndarray,
    at_wall: Callable[[Rays], tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    """Displacements along rays from the axis of a cell: inside the wall equal to the displacement of the wall, and
    linear from the wall to the border of the silicone around this cell.

    Parameters
    ----------
    pad, target : Dimensions
        The pad before and after the change, in mm.
    planes : tuple[list[ndarray], list[ndarray]]
        Planes that bound the regions of the pad and of the target; see :func:`region_planes`.
    points : (N, 3) ndarray
        Positions in mm.
    base : (N,) ndarray
        z of the origin of the ray through each point, on the axis of its cell, mm.
    at_wall : Callable
        Returns the distance (N,) from the origin at which rays meet the wall, and the displacements (N, 3) there for a
        cell whose axis is fixed, in mm.

    Returns
    -------
    (N, 3) ndarray
        Displacements in mm.
    """
    axes_before, axes_after = axes(pad), axes(target)
    index = [np.clip(np.searchsorted(planes[0][k], points[:, k]) - 1, 0, len(axes_before[k]) - 1) for k in range(2)]
    origin = np.column_stack([*(axes_before[k][index[k]] for k in range(2)), base])
    ray = points - origin
    length = np.linalg.norm(ray, axis=1)
    ray /= np.maximum(length, np.finfo(float).tiny)[:, None]

    # The border of the share: the planes around it, the bottom, and the top of the pad.
    low, high = (np.stack([planes[0][k][index[k] + end] for k in range(2)], axis=1) for end in (0, 1))
    low, high = np.column_stack([low, np.zeros(len(low))]), np.column_stack([high, np.full(len(high), pad.height)])
    with np.errstate(divide="ignore", invalid="ignore"):
        distances = np.where(ray > 0, high - origin, origin - low) / np.abs(ray)
    border = np.minimum(np.where(ray != 0, distances, np.inf).min(axis=1), 10 * sum(pad.extent))
    border_shift = shifts_between_planes(origin + border[:, None] * ray, *planes)

    wall, wall_shift = at_wall(Rays(origin, ray, length, border_shift))
    for k in range(2):
        wall_shift[:, k] += (axes_after[k] - axes_before[k])[index[k]]
    fraction = np.clip((length - wall) / (border - wall), 0.0, 1.0)[:, None]
    return (1 - fraction) * wall_shift + fraction * border_shift
