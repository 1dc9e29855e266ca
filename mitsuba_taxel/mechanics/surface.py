"""The deformed surface of a pad as flat triangles, fine enough to keep the curvature of its roofs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.mechanics.finish import Finish, fine_subdivision
from mitsuba_taxel.mechanics.path import State
from mitsuba_taxel.mechanics.relief import Relief, SmoothSurface, displacement_gradient
from mitsuba_taxel.mechanics.six_node import shape_functions
from mitsuba_taxel.pads.pad import REGIONS
from mitsuba_taxel.pads.volume_mesh import VolumeMesh


@dataclass(frozen=True)
class Surface:
    """A closed triangle mesh.

    Attributes
    ----------
    vertices : (V, 3) mm
    triangles : (T, 3) vertex numbers, counter-clockwise seen from outside the silicone
    region : (T,) region codes
    cell : (T,) number of the cell that a roof or side belongs to, 0 elsewhere
    """

    vertices: np.ndarray
    triangles: np.ndarray
    region: np.ndarray
    cell: np.ndarray


def tessellate(
    state: State, subdivision: int = 12, finish: Finish | None = None, cells: Sequence[int] | None = None
) -> Surface:
    """Cut each curved face of the deformed pad into triangles.

    The longest edge of a face of ``cells`` (numbers; None for all) is cut into ``subdivision`` segments, others into as
    many as keep theirs no longer. Other faces are cut into 4 triangles, as their mid-edge nodes need, or into a fan
    where they touch a cell, so that the surface is closed. A ``finish`` is laid on the faces of the undeformed cells,
    cut as fine as it needs, and carried by the deformation: see :class:`Relief`.

    Raises
    ------
    InputError
        if there is no cell of such a number, a finish is asked for on a part of the cells, or it needs more than
        `MOST_TRIANGLES`.
    """
    mesh = state.mesh
    chosen = _chosen(mesh, cells, finish)
    if finish is not None:
        subdivision = fine_subdivision(mesh, finish, subdivision)
    cut = _cut(mesh, subdivision, chosen)
    vertices, triangles, faces = cut.at_vertices(mesh.points + state.displacement), cut.triangles, cut.faces
    if finish is not None:
        relief = _relief(mesh, subdivision, finish)
        gradient = displacement_gradient(mesh, state.displacement)
        vertices = relief.carried(vertices, cut.at_vertices(gradient.reshape(-1, 9)).reshape(-1, 3, 3))
        triangles, faces = relief.triangles, faces[relief.parents]
    return Surface(vertices, triangles, mesh.face_region[faces], mesh.face_cell[faces])


def _chosen(mesh: VolumeMesh, cells: Sequence[int] | None, finish: Finish | None) -> tuple[int, ...] | None:
    """The cells to be cut finely, None for all."""
    if cells is None:
        return None
    if finish is not None:
        raise InputError("read_cells is not allowed with a finish: it is laid on all cells.")
    missing = [cell for cell in cells if cell not in mesh.face_cell or cell < 1]
    if missing:
        raise InputError(
            f"read_cells = {missing[0]} is not allowed: the pad's cells have numbers from 1 to {mesh.face_cell.max()}."
        )
    return tuple(cells)


@lru_cache(maxsize=2)  # the states of a path share their mesh
def _relief(mesh: VolumeMesh, subdivision: int, finish: Finish) -> Relief:
    cut = _cut(mesh, subdivision)
    return finish.relief(SmoothSurface(cut.at_vertices(mesh.points), cut.triangles, mesh.face_region[cut.faces]))


@dataclass(frozen=True)
class _Cut:
    """Vertices as ``weights`` (V, 6) of the ``nodes`` (V, 6) of a face; triangles, and the ``faces`` (T,) they cut."""

    nodes: np.ndarray
    weights: np.ndarray
    triangles: np.ndarray
    faces: np.ndarray

    def at_vertices(self, values: np.ndarray) -> np.ndarray:
        """(V, C) values at the vertices from those at the nodes of the mesh (N, C)."""
        return sum(self.weights[:, k, None] * values[self.nodes[:, k]] for k in range(6))


@lru_cache(maxsize=4)  # the states of a path share their mesh
def _cut(mesh: VolumeMesh, subdivision: int, cells: tuple[int, ...] | None = None) -> _Cut:
    in_cell = np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))
    if cells is not None:
        in_cell &= np.isin(mesh.face_cell, cells)
    segments = _segments(mesh, in_cell, subdivision)
    kinds, kind_of = np.unique(np.column_stack([in_cell, segments]), axis=0, return_inverse=True)
    patterns = []
    for kind, (finely, *edges) in enumerate(kinds.tolist()):
        even = len(set(edges)) == 1
        cut = _grid(edges[0]) if even else _snapped(edges) if finely else _fan(edges)
        patterns.append((np.flatnonzero(kind_of == kind), cut))

    keys, nodes, weights, triangles, faces, count = [], [], [], [], [], 0
    for chosen, (barycentric, pattern) in patterns:
        points = len(barycentric)
        keys.append(_keys(mesh.faces[chosen, :3], np.rint(6 * subdivision * barycentric).astype(np.int64)))
        nodes.append(np.repeat(mesh.faces[chosen], points, axis=0))
        weights.append(np.tile(shape_functions(barycentric), (len(chosen), 1)))
        first = count + points * np.arange(len(chosen))
        triangles.append((first[:, None, None] + pattern).reshape(-1, 3))
        faces.append(np.repeat(chosen, len(pattern)))
        count += points * len(chosen)
    _, kept, number = np.unique(np.concatenate(keys), axis=0, return_index=True, return_inverse=True)
    triangles = number.ravel()[np.concatenate(triangles)].astype(np.int32)
    return _Cut(np.concatenate(nodes)[kept], np.concatenate(weights)[kept], triangles, np.concatenate(faces))


def _grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric coordinates of the points of a triangle cut into n * n, and those triangles."""
    lattice = np.array([(n - i - j, i, j) for j in range(n + 1) for i in range(n + 1 - j)])
    number = {tuple(point): index for index, point in enumerate(lattice[:, 1:].tolist())}
    pattern = []
    for j in range(n):
        for i in range(n - j):
            pattern.append((number[i, j], number[i + 1, j], number[i, j + 1]))
            if i + j < n - 1:
                pattern.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    return lattice / n, np.array(pattern)


def _segments(mesh: VolumeMesh, in_cell: np.ndarray, subdivision: int) -> np.ndarray:
    """(F, 3) segments that each edge of each face is cut into: in cells so many that none is longer than those of the
    longest edge, elsewhere two, as its mid-edge node needs."""
    corners = mesh.points[mesh.faces[in_cell, :3]]
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    wanted = np.ceil(subdivision * length / length.max(initial=0.0) * (1 - 1e-9)).astype(int)
    of_node = np.full(len(mesh.points), 2)
    of_node[mesh.faces[in_cell, 3:]] = np.clip(wanted, min(2, subdivision), subdivision)
    return of_node[mesh.faces[:, 3:]]


def _snapped(segments: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """As :func:`_grid` of the most segments that an edge has, its points on the other edges moved to where these need
    them, and triangles left out that become lines: none gets much larger, or turns over."""
    n = max(segments)
    points, pattern = _grid(n)
    for k, count in enumerate(segments):
        start, end = np.eye(3)[[k, (k + 1) % 3]]
        on_edge = np.flatnonzero(points[:, k - 1] == 0)
        place = np.rint(n * points[on_edge, (k + 1) % 3]) * count / n
        # Ties go to the nearer end, where a triangle between two edges would become a line otherwise.
        place = np.where(2 * place < count, np.ceil(place - 0.5), np.floor(place + 0.5))
        points[on_edge] = start + place[:, None] / count * (end - start)
    points, number = np.unique(points, axis=0, return_inverse=True)
    pattern = number.ravel()[pattern]
    kept = (pattern != np.roll(pattern, 1, axis=1)).all(axis=1)
    return points, pattern[kept]


def _fan(segments: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric coordinates and triangles of a fan round the centre, with so many segments on each edge."""
    corners = np.eye(3)
    rim = np.array(
        [
            corners[k] + step / count * (corners[(k + 1) % 3] - corners[k])
            for k, count in enumerate(segments)
            for step in range(count)
        ]
    )
    around = np.arange(len(rim))
    pattern = np.stack([around, np.roll(around, -1), np.full(len(rim), len(rim))], axis=1)
    return np.concatenate([rim, np.full((1, 3), 1 / 3)]), pattern


def _keys(corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(F * P, 6) what is equal for points (P, 3 whole numbers) of faces (F, 3 corners) if they are one point.

    A point is known by the corners it has weight on, in order, and those weights.
    """
    shape = (len(corners), len(weights), 3)
    weights = np.broadcast_to(weights, shape)
    used = np.where(weights > 0, corners[:, None, :], -1)
    order = np.argsort(used, axis=2)
    keys = [np.take_along_axis(part, order, axis=2) for part in (used, weights)]
    return np.concatenate(keys, axis=2).reshape(-1, 6)
