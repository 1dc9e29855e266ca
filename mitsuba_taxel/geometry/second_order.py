"""Second-order elements and the boundary of a mesh of straight tetrahedra."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.unique_rows import unique_rows
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, TET_EDGES

_EDGE_NODE = {frozenset(edge): 4 + k for k, edge in enumerate(TET_EDGES)}
_SIDES = np.array(
    [
        [*corners, *(_EDGE_NODE[frozenset((corners[i], corners[j]))] for i, j in FACE_EDGES)]
        for corners in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
    ]
)
"""Nodes of the sides of a tetrahedron, counter-clockwise seen from outside."""


def positive(points: np.ndarray, tets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orient all tetrahedra positively, and drop points that no tetrahedron uses.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    tets : (M, 4) ndarray of int
        Corners of each tetrahedron.

    Returns
    -------
    points : (C, 3) ndarray
        Points that tetrahedra use.
    tets : (M, 4) ndarray of int
        Their corners among these.
    """
    used, tets = np.unique(tets, return_inverse=True)
    points, tets = points[used], tets.reshape(-1, 4).astype(np.int64)
    corners = points[tets]
    negative = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    return points, np.where(negative[:, None], tets[:, [0, 2, 1, 3]], tets)


def second_order(points: np.ndarray, tets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quadratic elements with straight edges, from straight tetrahedra.

    Parameters
    ----------
    points : (C, 3) ndarray
        The corners, which come first among the nodes, mm.
    tets : (M, 4) ndarray of int
        Corners of each tetrahedron, positively oriented.

    Returns
    -------
    nodes : (N, 3) ndarray
        Positions in mm.
    tets : (M, 10) ndarray of int
        Nodes of each tetrahedron, as in a `VolumeMesh`.
    faces : (B, 6) ndarray of int
        Nodes of each triangle of the boundary.
    """
    edges = np.sort(tets[:, np.array(TET_EDGES)].reshape(-1, 2), axis=1)
    first, number = unique_rows(edges)
    tets = np.concatenate([tets, len(points) + number.reshape(-1, 6)], axis=1)
    return np.concatenate([points, points[edges[first]].mean(axis=1)]), tets, _once(tets[:, _SIDES].reshape(-1, 6))


def boundary_triangles(tets: np.ndarray) -> np.ndarray:
    """Faces that belong to only one tetrahedron.

    Parameters
    ----------
    tets : (M, 4) ndarray of int
        Corners of each tetrahedron.

    Returns
    -------
    (B, 3) ndarray of int
        Their corners, counter-clockwise seen from outside.
    """
    return _once(tets[:, _SIDES[:, :3]].reshape(-1, 3))


def _once(sides: np.ndarray) -> np.ndarray:
    """Select the rows of ``sides`` (S, ...) whose first three nodes occur in no other row: the faces on the boundary.
    """
    _, first, count = np.unique(np.sort(sides[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    return sides[np.sort(first[count == 1])]


def edge_ends(tets: np.ndarray) -> np.ndarray:
    """The two corners at the ends of the edge on which each of E mid-edge nodes lies.

    Parameters
    ----------
    tets : (M, 10) ndarray of int
        Nodes of each tetrahedron; corners have the smaller numbers.

    Returns
    -------
    (E, 2) ndarray of int
        Numbers of the two corners, in the order of the mid-edge nodes.
    """
    nodes, first = np.unique(tets[:, 4:], return_index=True)
    assert nodes[0] == tets[:, :4].max() + 1 and len(nodes) == nodes[-1] - nodes[0] + 1
    return tets[:, np.array(TET_EDGES)].reshape(-1, 2)[first]
