"""How silicone follows the walls of the cells, from a pad to one of other dimensions.

Each cell has a share of the pad, up to the midplanes between neighbours. Within it, shifts are interpolated linearly:
between planes, or along rays through the wall of the cell to the border of its share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.pads.cells.cell_shape import Dimensions


def axes(pad: Dimensions) -> list[np.ndarray]:
    """x of the columns' axes and y of the rows', ascending, mm."""
    return [(np.arange(count) - 0.5 * (count - 1)) * pad.pitch for count in (pad.columns, pad.rows)]


def shares(pad: Dimensions, levels: list[float]) -> list[np.ndarray]:
    """x, y and z of planes: the outside of a pad and the midplanes between its cells, and some ``levels``, mm."""
    within = [0.5 * (along[1:] + along[:-1]) for along in axes(pad)]
    return [*_enclosed(pad, within), np.array(levels)]


def walls(pad: Dimensions, levels: list[float]) -> list[np.ndarray]:
    """x, y and z of planes: the outside of a pad and the walls of its cuboid cells, and some ``levels``, mm."""
    around = 0.5 * pad.cell_size * np.array([-1, 1])
    within = [(along[:, None] + around).ravel() for along in axes(pad)]
    return [*_enclosed(pad, within), np.array(levels)]


def _enclosed(pad: Dimensions, within: list[np.ndarray]) -> list[np.ndarray]:
    return [np.array([-0.5 * width, *inside, 0.5 * width]) for inside, width in zip(within, pad.extent, strict=False)]


def between_planes(points: np.ndarray, planes: list[np.ndarray], others: list[np.ndarray]) -> np.ndarray:
    """(N, 3) shifts of points (N, 3) that keep their relative position between planes that move to others."""
    columns = [
        np.interp(points[:, k], here, there - here) for k, (here, there) in enumerate(zip(planes, others, strict=True))
    ]
    return np.stack(columns, axis=1)


@dataclass(frozen=True)
class Rays:
    """Rays from the axis of a cell through points of its share.

    Attributes
    ----------
    origin, direction : (N, 3) ndarray
        Places on the axis; unit vectors.
    length : (N,) ndarray
        Distance of the points, mm.
    outside : (N, 3) ndarray
        Shifts where the rays leave the share, mm.
    """

    origin: np.ndarray
    direction: np.ndarray
    length: np.ndarray
    outside: np.ndarray

    def at(self, distance: np.ndarray) -> np.ndarray:
        """(N, 3) places at distances (N,) from the origin."""
        return self.origin + distance[:, None] * self.direction


def along_rays(
    pad: Dimensions,
    other: Dimensions,
    planes: tuple[list[np.ndarray], list[np.ndarray]],
    points: np.ndarray,
    base: np.ndarray,
    at_wall: Callable[[Rays], tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    """Shifts of silicone along rays, of the wall up to there, and linear from there to the border of the cell's share.

    Parameters
    ----------
    planes
        Of the shares of the pad, and of the other.
    points : (N, 3) ndarray
        mm.
    base : (N,) ndarray
        z of the origin of the ray through each point, on the axis of its cell.
    at_wall : Callable
        Gives the distance (N,) from the origin at which rays meet the wall, and the shifts (N, 3) there, of a cell
        whose axis stays where it is, in mm.

    Returns
    -------
    (N, 3) ndarray
    """
    here, there = axes(pad), axes(other)
    place = [np.clip(np.searchsorted(planes[0][k], points[:, k]) - 1, 0, len(here[k]) - 1) for k in range(2)]
    origin = np.column_stack([*(here[k][place[k]] for k in range(2)), base])
    ray = points - origin
    length = np.linalg.norm(ray, axis=1)
    ray /= np.maximum(length, np.finfo(float).tiny)[:, None]

    # The border of the share: the planes around it, the bottom, and the top of the pad.
    low, high = (np.stack([planes[0][k][place[k] + end] for k in range(2)], axis=1) for end in (0, 1))
    low, high = np.column_stack([low, np.zeros(len(low))]), np.column_stack([high, np.full(len(high), pad.height)])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(ray > 0, high - origin, origin - low) / np.abs(ray)
    border = np.minimum(np.where(ray != 0, reach, np.inf).min(axis=1), 10 * sum(pad.extent))
    outside = between_planes(origin + border[:, None] * ray, *planes)

    wall, inside = at_wall(Rays(origin, ray, length, outside))
    for k in range(2):
        inside[:, k] += (there[k] - here[k])[place[k]]
    share = np.clip((length - wall) / (border - wall), 0.0, 1.0)[:, None]
    return (1 - share) * inside + share * outside
