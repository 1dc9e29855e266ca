"""Velocities of a pad's nodes under changes of its dimensions, at fixed connectivity."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields
from functools import partial

import numpy as np

from mitsuba_taxel.base.arguments import refusal, require
from mitsuba_taxel.base.differences import STENCILS
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.second_order import edge_ends
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.pad import PROFILE, Pad
from mitsuba_taxel.pads.parametric.lean import AXES, lean, lean_rate, leans, on_round_walls, upright_nodes
from mitsuba_taxel.pads.profile import Meridian, from_axis, roof_of, side_of

STEP = 1e-3
"""Relative change of the difference quotient: positions are linear in each length."""
LEAN_STEP = 1e-4
"""The same of how far nodes lean, in mm."""
PROFILE_STEP = 1e-5
"""Change of the difference quotient for points of a profile."""

MeridianOf = Callable[[Pad], Meridian]
"""Of a profile: of its roof or its side."""


def mesh_velocity(pad: Pad, mesh: VolumeMesh, parameter: str) -> np.ndarray:
    """(N, 3) velocities of the nodes of a pad's undeformed mesh, in mm per mm of one of its dimensions.

    The other dimensions are held fixed; an unset height of cells is the default at any size. A node on a wall stays on
    it at the same relative position. Inside, velocities are interpolated: linearly between the walls of cuboid cells,
    and along the ray from the axis of a round cell, or the centre of the circle at the base of its dome, to the border
    of its share of the pad. Midpoints of straight edges remain midpoints. Nodes of leaning cells move as they do in
    upright ones, and with the change of their shift.

    Parameters
    ----------
    mesh : VolumeMesh
        Of the pad, undeformed: ``state.mesh`` of its states.
    parameter : str
        One of pitch, wall, height, cell_size, cell_height, top_x and top_y, or of the points of a profile,
        ``profile_r1`` and so on.

    Raises
    ------
    InputError
        if the pad has no derivative with respect to the parameter, or its dimension cannot be changed at all.
    """
    require("pad", pad, Pad, "a Pad")
    require("mesh", mesh, VolumeMesh, "a VolumeMesh")
    if not (isinstance(parameter, str) and parameter in pad.dimensions):
        whole = isinstance(parameter, str) and parameter in (field.name for field in fields(pad))
        reason = "it does not change continuously" if whole else f"one of {', '.join(pad.dimensions)} is needed"
        raise refusal("parameter", parameter, reason)
    upright = upright_nodes(pad, mesh)
    if parameter in AXES:
        return lean_rate(pad, mesh, upright, parameter)
    other, step = _changed(pad, parameter)

    def meridian_shift(of: MeridianOf, u: np.ndarray) -> np.ndarray:
        return step * rate_by(pad, parameter, PROFILE_STEP, partial(_meridian_at, of, u))

    velocity = Shifts(pad, other, meridian_shift).at(upright) / step
    middles = velocity[mesh.corner_count :]
    straight = ~on_round_walls(pad, mesh)[mesh.corner_count :]
    middles[straight] = velocity[edge_ends(mesh.tets)[straight]].mean(axis=1)
    if not leans(pad):
        return velocity
    return velocity + rate_by(
        pad, parameter, LEAN_STEP, lambda changed, step: lean(changed, mesh, upright + step * velocity)
    )


def _changed(pad: Pad, parameter: str) -> tuple[Pad, float]:
    """The pad with a slightly larger dimension, or a smaller one if that is not allowed, and the change."""
    value = pad.dimensions[parameter]
    step = STEP * value
    try:
        return pad.changed(**{parameter: value + step}), step
    except InputError:
        return pad.changed(**{parameter: value - step}), -step


def rate_by(pad: Pad, parameter: str, step: float, at: Callable[[Pad, float], np.ndarray]) -> np.ndarray:
    """Derivative by a dimension of what a changed pad and the change give.

    Raises
    ------
    InputError
        if the dimension cannot be changed.
    """
    value = pad.dimensions[parameter]
    for stencil in STENCILS:
        try:
            pads = [pad.changed(**{parameter: value + offset * step}) for _, offset in stencil]
        except InputError as error:
            refused = error
        else:
            values = (w * at(changed, offset * step) for (w, offset), changed in zip(stencil, pads, strict=True))
            return sum(values, start=np.zeros(1)) / step
    raise refused


class Shifts:
    """Shifts of the silicone from a pad with upright cells to ``other``, of any other dimensions.

    A point of a wall stays on it, at the same relative position.

    Parameters
    ----------
    meridian_shift : Callable[[Callable[[Pad], Meridian], ndarray], ndarray]
        (M, 2) shifts in mm of places u (M,) of the meridian of the roof or side of a profile.
    """

    def __init__(self, pad: Pad, other: Pad, meridian_shift: Callable[[MeridianOf, np.ndarray], np.ndarray]) -> None:
        self._pad, self._meridian_shift = pad, meridian_shift
        self._lines, self._axes = _lines(pad), _axes(pad)
        self._line_shifts = [there - here for here, there in zip(self._lines, _lines(other), strict=True)]
        self._axis_shifts = [there - here for here, there in zip(self._axes, _axes(other), strict=True)]
        self._growth = (other.cell_size - pad.cell_size) / pad.cell_size
        self._centre = pad.top_of_cell - pad.dome_radius
        self._centre_shift = other.top_of_cell - other.dome_radius - self._centre

    def at(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) shifts in mm of points (N, 3) of the silicone."""
        return self._between_lines(points) if self._pad.cell == "parallelepiped" else self._round_cells(points)

    def _between_lines(self, points: np.ndarray) -> np.ndarray:
        columns = [np.interp(points[:, k], self._lines[k], self._line_shifts[k]) for k in range(3)]
        return np.stack(columns, axis=1)

    def _round_cells(self, points: np.ndarray) -> np.ndarray:
        """Along rays from ``origin`` through a wall of the cell to the border of its share of the pad."""
        pad, radius = self._pad, 0.5 * self._pad.cell_size
        place = [
            np.clip(np.searchsorted(self._lines[k], points[:, k]) - 1, 0, len(self._axes[k]) - 1) for k in range(2)
        ]
        profiled = pad.cell == PROFILE
        above = (points[:, 2] > pad.side_height) & (pad.dome_radius > 0)
        base = np.where(above, pad.side_height, 0.0 if profiled else points[:, 2])
        origin = np.column_stack([*(self._axes[k][place[k]] for k in range(2)), base])
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
        outside = self._between_lines(origin + border[:, None] * ray)
        if profiled:
            wall, inside = self._on_profile(ray)
        else:
            on_wall = origin + np.minimum(length, wall)[:, None] * ray
            inside = self._growth * (on_wall - origin)
        inside[:, 0] += self._axis_shifts[0][place[0]]
        inside[:, 1] += self._axis_shifts[1][place[1]]
        if not profiled:
            inside[:, 2] = np.where(
                above, self._centre_shift + self._growth * (on_wall[:, 2] - self._centre), outside[:, 2]
            )
        share = np.clip((length - wall) / (border - wall), 0.0, 1.0)[:, None]
        return (1 - share) * inside + share * outside

    def _on_profile(self, ray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N,) distance of the wall along rays (N, 3) from the middle of a cell's opening, and its shifts there."""
        across = from_axis(self._pad.is_square, ray)[0]
        wall, shift = np.empty(len(ray)), np.empty_like(ray)
        rim = math.atan2(*roof_of(self._pad).at(np.ones(1))[0][0, ::-1])
        up = np.arctan2(ray[:, 2], across)
        for of, here in ((roof_of, up > rim), (side_of, up <= rim)):
            u = of(self._pad).along(np.column_stack([across, ray[:, 2]])[here])
            out = ray[here, :2] / across[here, None]
            r, z = of(self._pad).at(u)[0].T
            wall[here] = np.hypot(r * np.linalg.norm(out, axis=1), z)
            along = self._meridian_shift(of, u)
            shift[here] = np.column_stack([along[:, :1] * out, along[:, 1]])
        return wall, shift


def _meridian_at(of: MeridianOf, u: np.ndarray, pad: Pad, _: float) -> np.ndarray:
    return of(pad).at(u)[0]


def _lines(pad: Pad) -> list[np.ndarray]:
    """Along x, y and z: the outside, the midplanes between cells or, for cuboid ones, their walls, and the roofs."""
    lines = []
    for axes, width in zip(_axes(pad), pad.extent, strict=False):
        walls = axes[:, None] + 0.5 * pad.cell_size * np.array([-1, 1])
        within = walls.ravel() if pad.cell == "parallelepiped" else 0.5 * (axes[1:] + axes[:-1])
        lines.append(np.array([-0.5 * width, *within, 0.5 * width]))
    return [*lines, np.array([0.0, pad.height] if pad.cell == PROFILE else [0.0, pad.side_height, pad.height])]


def _axes(pad: Pad) -> list[np.ndarray]:
    """x of the columns' axes and y of the rows', ascending."""
    return [(np.arange(count) - 0.5 * (count - 1)) * pad.pitch for count in (pad.columns, pad.rows)]
