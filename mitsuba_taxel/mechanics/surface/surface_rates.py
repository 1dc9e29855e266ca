"""Derivatives of the triangles of a deformed surface with respect to the nodes of its pad, for a constant
subdivision."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mitsuba_taxel.base.arguments import array_of
from mitsuba_taxel.geometry.surfaces.triangles import unit
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.cutting import cut_faces, in_cells
from mitsuba_taxel.mechanics.surface.tessellation import chosen_cells, knows_walls, placed
from mitsuba_taxel.pads.any_pad import AnyPad
from mitsuba_taxel.pads.imported.round_faces import round_walls

ROUND = 1e-6
"""Tolerance of nodal velocities, relative to the largest, for a wall that remains round."""


def surface_rates(
    state: State,
    subdivision: int,
    pad: AnyPad | None,
    displacement_rate: np.ndarray,
    shape_velocity: np.ndarray | None = None,
    cells: Sequence[int] | None = None,
) -> np.ndarray:
    """Derivative of the vertices of a deformed surface with respect to a parameter of the pad. The surface is the
    result of :func:`tessellate` without a finish.

    Parameters
    ----------
    state : State
        The deformed pad.
    subdivision : int
        Segments into which the longest edge of a face of ``cells`` is divided. See :func:`tessellate`.
    pad : AnyPad or None
        The pad, if it has round walls: the undeformed surface is then that of the walls rather than of their elements.
        See :func:`tessellate`.
    displacement_rate : (N, 3) ndarray
        Derivative of the displacement of the N nodes with respect to the parameter, in mm per unit, as from
        :meth:`LinearisedState.by_value` and similar methods.
    shape_velocity : (N, 3) ndarray, optional
        Derivative of the positions of the undeformed nodes with respect to the parameter, in mm per unit; 0 by default.
        Vertices stay on walls that remain round; on other walls they move with the elements.
    cells : sequence of int, optional
        Numbers of the cells that are subdivided. See :func:`tessellate`.

    Returns
    -------
    (V, 3) ndarray
        Derivative of each of V vertices, in mm per unit of the parameter.

    Raises
    ------
    InputError
        if an array has another shape or is not finite, or a cell number does not exist.
    """
    mesh, chosen = state.mesh, chosen_cells(state.mesh, cells, None)
    cut = cut_faces(mesh, subdivision, chosen)
    rates = cut.at_vertices(array_of("displacement_rate", displacement_rate, mesh.points.shape))
    if shape_velocity is None:
        return rates
    velocity = array_of("shape_velocity", shape_velocity, mesh.points.shape)
    vertex_moves = cut.at_vertices(velocity)
    if knows_walls(pad):
        face = cut.face[cut.of_vertex]
        on_walls = np.flatnonzero(in_cells(mesh, chosen)[face])
        face = face[on_walls]
        positions, gradient = placed(mesh, face, cut.at_vertices(mesh.points)[on_walls], pad)
        wall_moves = vertex_moves[on_walls]
        for on_wall, centre, growth in _changing_walls(mesh, face, positions, velocity):
            wall_moves[on_wall] = (
                np.einsum("vij,vj->vi", gradient[on_wall], wall_moves[on_wall] - centre) + centre + growth
            )
        vertex_moves[on_walls] = wall_moves
    return rates + vertex_moves


def surface_gradient(
    state: State, subdivision: int, gradient: np.ndarray, cells: Sequence[int] | None = None
) -> np.ndarray:
    """Derivatives of a scalar with respect to nodal displacements, from its derivatives with respect to the vertices of
    :func:`tessellate`.

    This is the transpose of :func:`surface_rates`, for :meth:`LinearisedState.pull_back`. If the parameter changes the
    undeformed shape, the derivative has a second term: the sum of ``gradient`` times the result of
    :func:`surface_rates` for a displacement rate of 0.

    Parameters
    ----------
    state : State
        The deformed pad.
    subdivision : int
        Segments into which the longest edge of a face of ``cells`` is divided. See :func:`tessellate`.
    gradient : (V, 3) ndarray
        Derivatives with respect to the vertices, per mm.
    cells : sequence of int, optional
        Numbers of the cells that are subdivided. See :func:`tessellate`.

    Returns
    -------
    (N, 3) ndarray
        Derivatives with respect to the displacement of each node, per mm.

    Raises
    ------
    InputError
        if ``gradient`` has another shape or is not finite, or a cell number does not exist.
    """
    cut = cut_faces(state.mesh, subdivision, chosen_cells(state.mesh, cells, None))
    gradient = array_of("gradient", gradient, (len(cut.of_vertex), 3))
    return cut.at_nodes(gradient, len(state.mesh.points))


def _changing_walls(
    mesh: VolumeMesh, face: np.ndarray, positions: np.ndarray, velocity: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """For each wall that remains round: its vertices, the rate (3,) of its centre, and the rates (n, 3) of its vertices
    due to the rate of its radius."""
    for code, number, (centre, radius, projection) in round_walls(mesh):
        nodes = np.unique(mesh.faces[(mesh.face_region == code) & (mesh.face_cell == number)])
        axes = int(projection.trace())
        normals = ((mesh.points[nodes] - centre) @ projection / radius)[:, :axes]
        outwards = (normals * velocity[nodes, :axes]).sum(axis=1)
        equations = np.column_stack([normals, np.ones(len(nodes))])
        solution = np.linalg.lstsq(equations, outwards, rcond=None)[0]
        if np.abs(equations @ solution - outwards).max() > ROUND * np.abs(velocity).max():
            continue
        on_wall = (mesh.face_region[face] == code) & (mesh.face_cell[face] == number)
        yield (
            on_wall,
            np.append(solution[:axes], 0.0)[:3],
            solution[axes] * unit((positions[on_wall] - centre) @ projection),
        )
