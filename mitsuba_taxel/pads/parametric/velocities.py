"""Velocities of a pad's nodes under changes of its dimensions, at fixed connectivity."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from mitsuba_taxel.base.arguments import refusal, require
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.second_order import edge_ends
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.pad import REGIONS, Pad
from mitsuba_taxel.pads.parametric.round_walls import is_round

DIMENSIONS = ("pitch", "wall", "height", "cell_size", "cell_height")
"""Dimensions of a pad that have derivatives."""
STEP = 1e-3
"""Relative change of the difference quotient: all positions are linear in each dimension."""


def mesh_velocity(pad: Pad, mesh: VolumeMesh, parameter: str) -> np.ndarray:
    """(N, 3) velocities of the nodes of a pad's undeformed mesh, in mm per mm of one of its dimensions.

    The other dimensions are held fixed; an unset height of cells is the default at any size. A node on a wall stays on
    it at the same relative position. Inside, velocities are interpolated: linearly between the walls of cuboid cells,
    and along the ray from the axis of a round cell, or the centre of the circle at the base of its dome, to the border
    of its share of the pad. Midpoints of straight edges remain midpoints.

    Parameters
    ----------
    mesh : VolumeMesh
        Of the pad, undeformed: ``state.mesh`` of its states.
    parameter : str
        One of pitch, wall, height, cell_size and cell_height.

    Raises
    ------
    InputError
        if the pad has no derivative with respect to the parameter, or its dimension cannot be changed at all.
    """
    require("pad", pad, Pad, "a Pad")
    require("mesh", mesh, VolumeMesh, "a VolumeMesh")
    if not (isinstance(parameter, str) and parameter in DIMENSIONS):
        whole = isinstance(parameter, str) and parameter in (field.name for field in fields(pad))
        reason = "it does not change continuously" if whole else f"one of {', '.join(DIMENSIONS)} is needed"
        raise refusal("parameter", parameter, reason)
    grid = _Grid(pad, *_changed(pad, parameter))
    velocity = grid.at(mesh.points)
    middles = velocity[mesh.corner_count :]
    straight = ~_on_round_walls(pad, mesh)[mesh.corner_count :]
    middles[straight] = velocity[edge_ends(mesh.tets)[straight]].mean(axis=1)
    return velocity


def _changed(pad: Pad, parameter: str) -> tuple[Pad, float]:
    """The pad with a slightly larger dimension, or a smaller one if that is not allowed, and the change."""
    step = STEP * getattr(pad, parameter)
    try:
        return pad.changed(**{parameter: getattr(pad, parameter) + step}), step
    except InputError:
        return pad.changed(**{parameter: getattr(pad, parameter) - step}), -step


def _on_round_walls(pad: Pad, mesh: VolumeMesh) -> np.ndarray:
    codes = [REGIONS[name] for name in ("roof", "side") if is_round(pad, name)]
    on_wall = np.zeros(len(mesh.points), dtype=bool)
    on_wall[mesh.faces[np.isin(mesh.face_region, codes)]] = True
    return on_wall


class _Grid:
    """Grid lines of a pad, and their velocities towards those of ``other``, which differs by ``step``."""

    def __init__(self, pad: Pad, other: Pad, step: float) -> None:
        self._pad = pad

        def rate(here: np.ndarray, there: np.ndarray) -> np.ndarray:
            return (there - here) / step

        self._lines = _lines(pad)
        self._line_rates = [rate(*pair) for pair in zip(self._lines, _lines(other), strict=True)]
        self._axes = _axes(pad)
        self._axis_rates = [rate(*pair) for pair in zip(self._axes, _axes(other), strict=True)]
        self._growth = (other.cell_size - pad.cell_size) / step / pad.cell_size
        self._centre = pad.top_of_cell - pad.dome_radius
        self._centre_rate = (other.top_of_cell - other.dome_radius - self._centre) / step

    def at(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) velocities at points (N, 3) of the silicone."""
        return self._between_lines(points) if self._pad.cell == "parallelepiped" else self._round_cells(points)

    def _between_lines(self, points: np.ndarray) -> np.ndarray:
        columns = [np.interp(points[:, k], self._lines[k], self._line_rates[k]) for k in range(3)]
        return np.stack(columns, axis=1)

    def _round_cells(self, points: np.ndarray) -> np.ndarray:
        """Along rays from ``origin`` through a wall of the cell to the border of its share of the pad."""
        pad, radius = self._pad, 0.5 * self._pad.cell_size
        place = [
            np.clip(np.searchsorted(self._lines[k], points[:, k]) - 1, 0, len(self._axes[k]) - 1) for k in range(2)
        ]
        origin = np.stack([self._axes[k][place[k]] for k in range(2)] + [points[:, 2]], axis=1)
        above = (points[:, 2] > pad.side_height) & (pad.dome_radius > 0)
        origin[above, 2] = pad.side_height
        ray = points - origin
        length = np.linalg.norm(ray, axis=1)
        ray /= np.maximum(length, np.finfo(float).tiny)[:, None]

        low, high = (np.stack([self._lines[k][place[k] + end] for k in range(2)], axis=1) for end in (0, 1))
        low, high = np.column_stack([low, np.zeros(len(low))]), np.column_stack([high, np.full(len(high), pad.height)])
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(ray > 0, high - origin, origin - low) / np.abs(ray)
        border = np.minimum(np.where(ray != 0, reach, np.inf).min(axis=1), 10 * sum(pad.extent))
        drop = (pad.side_height - self._centre) * above * (pad.dome_radius > 0) * ray[:, 2]
        wall = np.sqrt(drop**2 + radius**2) - drop  # of the sphere through the circle of that radius about the origin

        on_wall = origin + np.minimum(length, wall)[:, None] * ray
        outside = self._between_lines(origin + border[:, None] * ray)
        inside = self._growth * (on_wall - origin)
        inside[:, 0] += self._axis_rates[0][place[0]]
        inside[:, 1] += self._axis_rates[1][place[1]]
        inside[:, 2] = np.where(above, self._centre_rate + self._growth * (on_wall[:, 2] - self._centre), outside[:, 2])
        share = np.clip((length - wall) / (border - wall), 0.0, 1.0)[:, None]
        return (1 - share) * inside + share * outside


def _lines(pad: Pad) -> list[np.ndarray]:
    """Along x, y and z: the outside, the midplanes between cells or, for cuboid ones, their walls, and the roofs."""
    lines = []
    for axes, width in zip(_axes(pad), pad.extent, strict=False):
        walls = axes[:, None] + 0.5 * pad.cell_size * np.array([-1, 1])
        within = walls.ravel() if pad.cell == "parallelepiped" else 0.5 * (axes[1:] + axes[:-1])
        lines.append(np.array([-0.5 * width, *within, 0.5 * width]))
    return [*lines, np.array([0.0, pad.side_height, pad.height])]


def _axes(pad: Pad) -> list[np.ndarray]:
    """x of the columns' axes and y of the rows', ascending."""
    return [(np.arange(count) - 0.5 * (count - 1)) * pad.pitch for count in (pad.columns, pad.rows)]
