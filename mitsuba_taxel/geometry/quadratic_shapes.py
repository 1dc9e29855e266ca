"""Quadratic shape functions of triangles and tetrahedra: corners first, then edges as in FACE_EDGES or TET_EDGES."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, TET_EDGES


def shape_functions(barycentric: np.ndarray) -> np.ndarray:
    """Values of the quadratic shape functions.

    Parameters
    ----------
    barycentric : (Q, 3) or (Q, 4) ndarray
        Coordinates in a triangle or in a tetrahedron.

    Returns
    -------
    (Q, 6) or (Q, 10) ndarray
        Value of the shape function of each node.
    """
    i, j = np.array(FACE_EDGES if barycentric.shape[1] == 3 else TET_EDGES).T
    return np.concatenate([barycentric * (2 * barycentric - 1), 4 * barycentric[:, i] * barycentric[:, j]], axis=1)


def shape_slopes(barycentric: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the quadratic shape functions of a triangle.

    Parameters
    ----------
    barycentric : (Q, 3) ndarray
        Coordinates in the triangle.

    Returns
    -------
    to_second, to_third : (Q, 6) ndarray
        Derivatives along the sides from the first corner to the second and to the third.
    """
    a, b, c = barycentric.T
    zero = np.zeros_like(a)
    to_second = np.stack([1 - 4 * a, 4 * b - 1, zero, 4 * (a - b), 4 * c, -4 * c], axis=1)
    to_third = np.stack([1 - 4 * a, zero, 4 * c - 1, -4 * b, 4 * b, 4 * (a - c)], axis=1)
    return to_second, to_third


def shape_gradients(xi: np.ndarray) -> np.ndarray:
    """Gradients of the quadratic shape functions of a tetrahedron.

    Parameters
    ----------
    xi : (Q, 3) ndarray
        Points of the reference element.

    Returns
    -------
    (Q, 10, 3) ndarray
        Derivatives with respect to the reference coordinates, for each node.
    """
    barycentric = tet_coordinates(xi)
    slope = np.array([[-1, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    gradients = np.empty((len(xi), 10, 3))
    gradients[:, :4] = (4 * barycentric - 1)[:, :, None] * slope
    for node, (i, j) in enumerate(TET_EDGES, start=4):
        gradients[:, node] = 4 * (barycentric[:, i, None] * slope[j] + barycentric[:, j, None] * slope[i])
    return gradients


def tet_coordinates(xi: np.ndarray) -> np.ndarray:
    """Barycentric coordinates in a tetrahedron, from its reference coordinates.

    Parameters
    ----------
    xi : (..., 3) ndarray
        Points of the reference element.

    Returns
    -------
    (..., 4) ndarray
        Barycentric coordinates, whose sum is 1.
    """
    return np.concatenate([1 - xi.sum(axis=-1, keepdims=True), xi], axis=-1)


def control_points(nodes: np.ndarray) -> np.ndarray:
    """Bezier control points of quadratic elements: their convex hull contains the element.

    Parameters
    ----------
    nodes : (M, 6, 3) or (M, 10, 3) ndarray
        Nodes of triangles or tetrahedra, mm.

    Returns
    -------
    ndarray
        In mm, of the same shape.
    """
    edges = FACE_EDGES if nodes.shape[1] == 6 else TET_EDGES
    i, j = np.array(edges).T
    corners = nodes.shape[1] - len(edges)
    return np.concatenate([nodes[:, :corners], 2 * nodes[:, corners:] - (nodes[:, i] + nodes[:, j]) / 2], axis=1)


def hull_boxes(points: np.ndarray, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounding boxes of quadratic elements, from their Bezier control points, which are not all in memory at once.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    nodes : (M, 6) or (M, 10) ndarray of int
        Nodes of triangles or tetrahedra.

    Returns
    -------
    low, high : (M, 3) ndarray
        Lowest and highest corners, mm.
    """
    edges = FACE_EDGES if nodes.shape[1] == 6 else TET_EDGES
    corners = [points[nodes[:, k]] for k in range(nodes.shape[1] - len(edges))]
    low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
    for k, (i, j) in enumerate(edges, start=len(corners)):
        control = 2 * points[nodes[:, k]] - (corners[i] + corners[j]) / 2
        np.minimum(low, control, out=low)
        np.maximum(high, control, out=high)
    return low, high
