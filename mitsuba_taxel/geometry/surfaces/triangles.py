"""Triangles of a surface: normals, edges, neighbours, nearest points."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mitsuba_taxel.geometry.surfaces.box_tree import overlapping


def area_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Normals of triangles, whose lengths are the areas.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle, counter-clockwise from outside.

    Returns
    -------
    (T, 3) ndarray
        Area normals in mm².
    """
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors scaled to length 1.

    Parameters
    ----------
    vectors : (..., 3) ndarray
        Vectors of any length.

    Returns
    -------
    (..., 3) ndarray
        0 where the length is 0.
    """
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Volume enclosed by a surface.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Returns
    -------
    float
        In mm³, negative if the triangles are clockwise seen from outside.
    """
    origin = vertices.mean(axis=0)
    a, b, c = (vertices[triangles[:, k]] - origin for k in range(3))
    return float(np.einsum("ij,ij->", np.cross(a, b), c) / 6)


def half_edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directed edges of triangles.

    Parameters
    ----------
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Returns
    -------
    edges : (3 T, 2) ndarray of int
        Start and end of each edge.
    owner : (3 T,) ndarray of int
        Number of its triangle.
    """
    return triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), np.repeat(np.arange(len(triangles)), 3)


def neighbours(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges that exactly two triangles share.

    Parameters
    ----------
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Returns
    -------
    edges : (E, 2) ndarray of int
        Vertices at their ends, the smaller number first.
    owners : (E, 2) ndarray of int
        Numbers of the two triangles.
    """
    edges, owner = half_edges(triangles)
    edges = np.sort(edges, axis=1).astype(np.int64)
    key = edges[:, 0] * (int(triangles.max(initial=0)) + 1) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    start = np.flatnonzero(np.diff(key[order], prepend=-1))
    twice = start[np.diff(start, append=len(order)) == 2]
    return edges[order[twice]], owner[np.stack([order[twice], order[twice + 1]], axis=1)]


def components(count: int, pairs: np.ndarray) -> np.ndarray:
    """Connected components of a graph.

    Parameters
    ----------
    count : int
        Number of nodes.
    pairs : (P, 2) ndarray of int
        Nodes at the ends of each edge.

    Returns
    -------
    (count,) ndarray of int
        Number of the component of each node.
    """
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def closest_on_triangles(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The nearest point of a triangle to a point, pair by pair.

    It is the projection onto the plane if that lies in the triangle, else the nearest of those on the three edges.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    corners : (N, 3, 3) ndarray
        Corners of the triangles, mm.

    Returns
    -------
    (N, 3) ndarray
        Nearest points on the triangles, mm.
    """
    a, b, c = (corners[:, k] for k in range(3))
    normal = unit(np.cross(b - a, c - a))
    foot = points - np.einsum("ij,ij->i", points - a, normal)[:, None] * normal
    inside = np.linalg.norm(normal, axis=1) > 0
    best = np.full(len(points), np.inf)
    nearest = np.empty_like(points)
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("ij,ij->i", np.cross(end - start, foot - start), normal) >= 0
        candidate = closest_on_segments(points, start, end)
        distance = np.linalg.norm(points - candidate, axis=1)
        nearest = np.where((distance < best)[:, None], candidate, nearest)
        best = np.minimum(best, distance)
    return np.where(inside[:, None], foot, nearest)


def closest_on_segments(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The nearest point of a segment to a point, pair by pair.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    start, end : (N, 3) ndarray
        Ends of the segments, mm.

    Returns
    -------
    (N, 3) ndarray
        Nearest points on the segments, mm.
    """
    along = end - start
    square = np.einsum("ij,ij->i", along, along)
    fraction = np.einsum("ij,ij->i", points - start, along) / np.where(square > 0, square, 1.0)
    return start + np.clip(fraction, 0, 1)[:, None] * along


def near(points: np.ndarray, corners: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of a point and another object (triangle, segment or point) whose bounding box is within ``reach`` of
    the point.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    corners : (M, K, 3) ndarray
        Corners of M triangles (K = 3), segments (K = 2) or points (K = 1), mm.
    reach : float
        Largest distance along an axis, mm.

    Returns
    -------
    point, element : (P,) ndarray of int
        Numbers of the point, and of the triangle, segment or point, of each pair.
    """
    return overlapping(points - reach, points + reach, corners.min(axis=1), corners.max(axis=1))


def first_of_each(keys: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """For each distinct key, the index of the entry with the least cost, among P entries.

    Parameters
    ----------
    keys : (P,) ndarray of int
        Keys, which are numbers from 0 on.
    cost : (P,) ndarray
        Cost of each entry.

    Returns
    -------
    ndarray of int
        Rows of these entries, by ascending key.
    """
    order = np.lexsort((cost, keys))
    return order[np.diff(keys[order], prepend=-1) > 0]


def subdivided(points: np.ndarray, triangles: np.ndarray, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles cut at given vertices that lie on their edges.

    Parameters
    ----------
    points : (V, 3) ndarray
        All vertices, mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    middle : (T, 3) ndarray of int
        The vertex on each edge, which begins at the corner of the same column; -1 for none.

    Returns
    -------
    triangles : (S, 3) ndarray of int
        Vertices of each triangle.
    parents : (S,) ndarray of int
        Number of the triangle that each is a part of.
    """
    cuts = (middle >= 0).sum(axis=1)
    pieces, parents = [triangles[cuts == 0]], [np.flatnonzero(cuts == 0)]

    def turned(rows: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        order = (first[:, None] + np.arange(3)) % 3
        return np.take_along_axis(triangles[rows], order, axis=1), np.take_along_axis(middle[rows], order, axis=1)

    def add(rows: np.ndarray, *new: list[np.ndarray]) -> None:
        for corners in new:
            pieces.append(np.stack(corners, axis=1))
            parents.append(rows)

    rows = np.flatnonzero(cuts == 1)
    (a, b, c), (m, _, _) = (x.T for x in turned(rows, np.argmax(middle[rows] >= 0, axis=1)))
    add(rows, [a, m, c], [m, b, c])
    # Edges ab and bc are cut; the remaining quadrilateral is cut along its shorter diagonal.
    rows = np.flatnonzero(cuts == 2)
    (a, b, c), (m, n, _) = (x.T for x in turned(rows, (np.argmax(middle[rows] < 0, axis=1) + 1) % 3))
    from_a = np.linalg.norm(points[a] - points[n], axis=1) < np.linalg.norm(points[m] - points[c], axis=1)
    add(rows, [m, b, n], [np.where(from_a, a, m), np.where(from_a, m, n), np.where(from_a, n, c)])
    add(rows, [a, np.where(from_a, n, m), c])
    rows = np.flatnonzero(cuts == 3)
    (a, b, c), (m, n, o) = triangles[rows].T, middle[rows].T
    add(rows, [a, m, o], [m, b, n], [o, n, c], [m, n, o])
    return np.concatenate(pieces), np.concatenate(parents)
