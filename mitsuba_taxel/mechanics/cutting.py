"""Subdivision of the curved faces of a mesh's surface into triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_slopes
from mitsuba_taxel.geometry.unique_rows import unique_rows
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.regions import REGIONS

PLACES = 1 << 20
"""Barycentric coordinates are compared as whole multiples of 1 / PLACES. A power of 2: fractions k / n then never lie
half-way between two of these, where rounding would tell coincident points of two faces apart."""


@dataclass(frozen=True)
class Cut:
    """Triangles, and the ``faces`` (T,) they belong to. Points of several faces that coincide are one vertex.

    A point has ``weights`` (P, 6) at the ``nodes`` (P, 6) of its ``face`` (P,); ``slopes`` (2, P, 6) are the
    derivatives of these weights along two sides of it. ``of_vertex`` (V,) is a point of each vertex, ``vertex`` (P,)
    the vertex of each point; ``corners`` (T, 3) are the points of triangles.
    """

    nodes: np.ndarray
    weights: np.ndarray
    slopes: np.ndarray
    face: np.ndarray
    of_vertex: np.ndarray
    vertex: np.ndarray
    corners: np.ndarray
    faces: np.ndarray

    @property
    def triangles(self) -> np.ndarray:
        """(T, 3) vertex numbers."""
        return self.vertex[self.corners]

    def at_vertices(self, values: np.ndarray) -> np.ndarray:
        """(V, C) values at the vertices from those at the nodes of the mesh (N, C)."""
        return weighted(self.weights[self.of_vertex], self.nodes[self.of_vertex], values)

    def at_nodes(self, gradient: np.ndarray, nodes: int) -> np.ndarray:
        """(N, C) derivatives by the nodal values, from those by the values at the vertices (V, C)."""
        number, weights = self.nodes[self.of_vertex].ravel(), self.weights[self.of_vertex]
        shares = (np.bincount(number, (weights * column[:, None]).ravel(), nodes) for column in gradient.T)
        return np.stack(list(shares), axis=1)


def weighted(weights: np.ndarray, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(P, C) sums of the values (N, C) at nodes (P, 6), with weights (P, 6)."""
    return sum(weights[:, k, None] * values[nodes[:, k]] for k in range(6))


@kept(4)  # the states of a path share their mesh
def cut_faces(mesh: VolumeMesh, subdivision: int, cells: tuple[int, ...] | None = None) -> Cut:
    """The subdivided surface of a mesh, fine in ``cells`` (None for all); see :func:`tessellate`."""
    in_cell = in_cells(mesh, cells)
    segments = _segments(mesh, in_cell, subdivision)
    kinds, kind_of = np.unique(segments, axis=0, return_inverse=True)
    patterns = []
    for kind, edges in enumerate(kinds.tolist()):
        cut = _grid(edges[0]) if len(set(edges)) == 1 else _snapped(edges)
        patterns.append((np.flatnonzero(kind_of == kind), cut))

    keys, weights, slopes, face, corners, faces, count = [], [], [], [], [], [], 0
    for chosen, (barycentric, pattern) in patterns:
        points = len(barycentric)
        keys.append(_keys(mesh.faces[chosen, :3], np.rint(PLACES * barycentric).astype(np.int64)))
        weights.append(np.tile(shape_functions(barycentric), (len(chosen), 1)))
        slopes.append(np.tile(np.array(shape_slopes(barycentric)), (1, len(chosen), 1)))
        face.append(np.repeat(chosen, points))
        first = count + points * np.arange(len(chosen))
        corners.append((first[:, None, None] + pattern).reshape(-1, 3))
        faces.append(np.repeat(chosen, len(pattern)))
        count += points * len(chosen)
    of_point = np.concatenate(face)
    # At the edge of a roof, coincident points of sides come first.
    order = np.argsort(mesh.face_region[of_point] != REGIONS["side"], kind="stable")
    first, vertex = unique_rows(np.concatenate(keys)[order])
    number = np.empty_like(order)
    number[order] = vertex
    return Cut(
        mesh.faces[of_point],
        np.concatenate(weights),
        np.concatenate(slopes, axis=1),
        of_point,
        order[first],
        number.astype(np.int32),
        np.concatenate(corners),
        np.concatenate(faces),
    )


def in_cells(mesh: VolumeMesh, cells: tuple[int, ...] | None) -> np.ndarray:
    """(F,) whether each face is a roof or side of ``cells``, to be subdivided finely."""
    in_cell = np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))
    return in_cell if cells is None else in_cell & np.isin(mesh.face_cell, cells)


def _grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric coordinates of the points of a triangle subdivided into n * n triangles, and these triangles."""
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
    """(F, 3) number of segments of each edge of each face: in cells such that none is longer than those of the longest
    edge, elsewhere two, as required by the mid-edge node."""
    corners = mesh.points[mesh.faces[in_cell, :3]]
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    wanted = np.ceil(subdivision * length / length.max(initial=0.0) * (1 - 1e-9)).astype(int)
    of_node = np.full(len(mesh.points), 2)
    of_node[mesh.faces[in_cell, 3:]] = np.clip(wanted, min(2, subdivision), subdivision)
    return of_node[mesh.faces[:, 3:]]


def _snapped(segments: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """As :func:`_grid` for the edge with most segments, with points on the other edges moved to match theirs, and
    degenerate triangles left out: none becomes much larger, or inverted."""
    n = max(segments)
    points, pattern = _grid(n)
    for k, count in enumerate(segments):
        start, end = np.eye(3)[[k, (k + 1) % 3]]
        on_edge = np.flatnonzero(points[:, k - 1] == 0)
        place = np.rint(n * points[on_edge, (k + 1) % 3]) * count / n
        # Ties go to the nearer end, as a triangle between two edges would degenerate otherwise.
        place = np.where(2 * place < count, np.ceil(place - 0.5), np.floor(place + 0.5))
        points[on_edge] = start + place[:, None] / count * (end - start)
    points, number = np.unique(points, axis=0, return_inverse=True)
    pattern = number.ravel()[pattern]
    kept = (pattern != np.roll(pattern, 1, axis=1)).all(axis=1)
    return points, pattern[kept]


def _keys(corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(F * P, 6) keys that are equal for coincident points (P, 3 whole numbers) of faces (F, 3 corners).

    A point is identified by the corners with non-zero weights, in order, and these weights.
    """
    shape = (len(corners), len(weights), 3)
    weights = np.broadcast_to(weights, shape)
    used = np.where(weights > 0, corners[:, None, :], -1)
    order = np.argsort(used, axis=2)
    keys = [np.take_along_axis(part, order, axis=2) for part in (used, weights)]
    return np.concatenate(keys, axis=2).reshape(-1, 6)
