"""Subdivision of the curved faces of a mesh's surface into triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_slopes
from mitsuba_taxel.geometry.unique_rows import unique_rows
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.regions import REGIONS

DIVISIONS = 1 << 20
"""Barycentric coordinates are compared as integer multiples of 1 / DIVISIONS. For a power of 2, fractions k / n never
lie half-way between two multiples, where rounding would separate coincident points of two faces."""


@dataclass(frozen=True)
class Cut:
    """A mesh's surface, subdivided into T flat triangles with V vertices.

    Attributes
    ----------
    nodes : (P, 6) ndarray
        Nodes of the face of each point.
    weights : (P, 6) ndarray
        Weights of these nodes at the point.
    slopes : (2, P, 6) ndarray
        Derivatives of the weights along two sides of the face.
    face : (P,) ndarray
        Face of each point.
    of_vertex : (V,) ndarray
        A point of each vertex.
    vertex : (P,) ndarray
        Vertex of each point.
    corners : (T, 3) ndarray
        Points of the triangles.
    faces : (T,) ndarray
        Face of each triangle.
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
        """Vertex numbers (T, 3)."""
        return self.vertex[self.corners]

    def at_vertices(self, values: np.ndarray) -> np.ndarray:
        """Values (V, C) of C components at the V vertices, from values (N, C) at the N nodes of the mesh."""
        return weighted(self.weights[self.of_vertex], self.nodes[self.of_vertex], values)

    def at_nodes(self, gradient: np.ndarray, nodes: int) -> np.ndarray:
        """Derivatives (N, C) of a scalar with respect to C components at the N nodes, from its derivatives (V, C) at
        the V vertices, by the chain rule.
        """
        number, weights = self.nodes[self.of_vertex].ravel(), self.weights[self.of_vertex]
        sums = (np.bincount(number, (weights * column[:, None]).ravel(), nodes) for column in gradient.T)
        return np.stack(list(sums), axis=1)


def weighted(weights: np.ndarray, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values at points, as weighted sums of values at nodes.

    Parameters
    ----------
    weights : (P, 6) ndarray
        Weights of the nodes of each point.
    nodes : (P, 6) ndarray of int
        Their numbers.
    values : (N, C) ndarray
        Values at the nodes.

    Returns
    -------
    (P, C) ndarray
        Sums.
    """
    return sum(weights[:, k, None] * values[nodes[:, k]] for k in range(6))


@kept(4)  # the states of a path share their mesh
def cut_faces(mesh: VolumeMesh, subdivision: int, cells: tuple[int, ...] | None = None) -> Cut:
    """Subdivide the curved faces of a mesh's surface into triangles.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    subdivision : int
        Number of segments of the longest edge of a face in a cell; see :func:`tessellate`.
    cells : tuple[int, ...], optional
        Numbers of the cells that are subdivided finely; by default all.

    Returns
    -------
    Cut
        Triangles and vertices.
    """
    in_cell = in_cells(mesh, cells)
    segments = _segments(mesh, in_cell, subdivision)
    kinds, kind_of_face = np.unique(segments, axis=0, return_inverse=True)

    # One pattern of triangles for all faces with the same segments.
    patterns = []
    for kind, edges in enumerate(kinds.tolist()):
        cut = _grid(edges[0]) if len(set(edges)) == 1 else _snapped(edges)
        patterns.append((np.flatnonzero(kind_of_face == kind), cut))

    # Points and triangles of all faces, pattern by pattern.
    keys, weights, slopes, face, corners, parents, count = [], [], [], [], [], [], 0
    for chosen, (barycentric, pattern) in patterns:
        points = len(barycentric)
        keys.append(_keys(mesh.faces[chosen, :3], np.rint(DIVISIONS * barycentric).astype(np.int64)))
        weights.append(np.tile(shape_functions(barycentric), (len(chosen), 1)))
        slopes.append(np.tile(np.array(shape_slopes(barycentric)), (1, len(chosen), 1)))
        face.append(np.repeat(chosen, points))
        first = count + points * np.arange(len(chosen))
        corners.append((first[:, None, None] + pattern).reshape(-1, 3))
        parents.append(np.repeat(chosen, len(pattern)))
        count += points * len(chosen)

    # Coincident points become one vertex. At the edge of a roof, points of sides come first.
    of_point = np.concatenate(face)
    order = np.argsort(mesh.face_region[of_point] != REGIONS["side"], kind="stable")
    first, vertex = unique_rows(np.concatenate(keys)[order])
    vertex_of_point = np.empty_like(order)
    vertex_of_point[order] = vertex
    return Cut(
        mesh.faces[of_point],
        np.concatenate(weights),
        np.concatenate(slopes, axis=1),
        of_point,
        order[first],
        vertex_of_point.astype(np.int32),
        np.concatenate(corners),
        np.concatenate(parents),
    )


def in_cells(mesh: VolumeMesh, cells: tuple[int, ...] | None) -> np.ndarray:
    """Mask of the finely subdivided faces: roofs and sides of the given cells or, in a pad without cells, the top.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    cells : tuple[int, ...] or None
        Numbers of the cells; None for all, or for the top of a pad without cells.

    Returns
    -------
    (F,) ndarray of bool
        True for a face that is finely subdivided.
    """
    in_cell = np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))
    if cells is None and not in_cell.any():
        return mesh.face_region == REGIONS["top"]
    return in_cell if cells is None else in_cell & np.isin(mesh.face_cell, cells)


def _grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric coordinates of the points of a triangle that is subdivided into n * n triangles, and the points of
    these triangles."""
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
    """Number (F, 3) of segments into which each edge of F faces is divided.

    In cells, no segment is longer than the segments of the longest edge. Other edges have two segments, because they
    have a mid-edge node.
    """
    corners = mesh.points[mesh.faces[in_cell, :3]]
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    required = np.ceil(subdivision * length / length.max(initial=0.0) * (1 - 1e-9)).astype(int)
    of_node = np.full(len(mesh.points), 2)
    of_node[mesh.faces[in_cell, 3:]] = np.clip(required, min(2, subdivision), subdivision)
    return of_node[mesh.faces[:, 3:]]


def _snapped(segments: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of a subdivided face whose three edges have different numbers of ``segments`` (3,).

    The grid of the largest number is used: points on the other edges are moved to match their segments, and degenerate
    triangles are left out. No triangle becomes much larger, or inverted.
    """
    n = max(segments)
    points, pattern = _grid(n)
    for k, count in enumerate(segments):
        start, end = np.eye(3)[[k, (k + 1) % 3]]
        on_edge = np.flatnonzero(points[:, k - 1] == 0)
        position = np.rint(n * points[on_edge, (k + 1) % 3]) * count / n
        # Ties go to the nearer end, as a triangle between two edges would degenerate otherwise.
        position = np.where(2 * position < count, np.ceil(position - 0.5), np.floor(position + 0.5))
        points[on_edge] = start + position[:, None] / count * (end - start)
    points, number = np.unique(points, axis=0, return_inverse=True)
    pattern = number.ravel()[pattern]
    proper = (pattern != np.roll(pattern, 1, axis=1)).all(axis=1)
    return points, pattern[proper]


def _keys(corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Keys by which points of different faces are recognised as the same point: an integer array with one row for each
    of F * P points.

    Points have integer barycentric coordinates (P, 3) in faces with corners (F, 3). A key consists of the corners with
    non-zero weights, in order, and these weights.
    """
    shape = (len(corners), len(weights), 3)
    weights = np.broadcast_to(weights, shape)
    used = np.where(weights > 0, corners[:, None, :], -1)
    order = np.argsort(used, axis=2)
    keys = [np.take_along_axis(array, order, axis=2) for array in (used, weights)]
    return np.concatenate(keys, axis=2).reshape(-1, 6)
