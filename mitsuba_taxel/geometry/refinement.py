"""Refinement of second-order tetrahedra: bisection down to a given size, or division into given pieces.

Elements are bisected at their longest edge, and neighbours as needed for conformity (M.-C. Rivara, Int. J. Numer.
Methods Eng. 20, 1984): angles stay bounded. New nodes lie on the curved elements, so that the solid is unchanged.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mitsuba_taxel.geometry.geometry_error import GeometryError
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, TET_EDGES, VolumeMesh


def refined(mesh: VolumeMesh, size: Callable[[np.ndarray], np.ndarray], most: float = math.inf) -> VolumeMesh:
    """The mesh refined by bisection until no edge is too long.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of straight elements, mm.
    size : Callable
        Largest length (n,) of edges in mm at their middles (n, 3).
    most : float
        Largest number of elements.

    Returns
    -------
    VolumeMesh
        Mesh with the same surface.

    Raises
    ------
    GeometryError
        if more elements would be needed.
    """
    edges = np.array(TET_EDGES)
    while True:
        if len(mesh.tets) > most:
            raise GeometryError(f"more than {most:g} elements")
        tets = mesh.tets[:, :4]
        count = len(mesh.points)
        sides = np.sort(tets[:, edges], axis=2)
        keys, of_tets = np.unique(sides[..., 0] * count + sides[..., 1], return_inverse=True)
        of_tets, ends = of_tets.reshape(-1, 6), np.stack(np.divmod(keys, count), axis=1)
        coordinates = mesh.points[ends]
        squared = ((coordinates[:, 0] - coordinates[:, 1]) ** 2).sum(axis=1)
        rank = np.empty(len(ends), dtype=np.int64)
        rank[np.argsort(squared, kind="stable")] = np.arange(len(ends))
        # Edges are ranked by length, so that neighbours agree on the longer of two equal edges.
        longest = np.take_along_axis(of_tets, rank[of_tets].argmax(axis=1)[:, None], axis=1)
        cut = _with_longest(squared > size(coordinates.mean(axis=1)) ** 2, of_tets, longest)
        if not cut.any():
            return mesh
        # They are cut in a later round, when they are the longest.
        cut[of_tets[cut[of_tets] & (of_tets != longest)]] = False
        mesh = bisected(mesh, ends[cut])


def _with_longest(cut: np.ndarray, of_tets: np.ndarray, longest: np.ndarray) -> np.ndarray:
    """Mask (E,) of the edges to be cut: those marked in ``cut``, and the longest edge of every element that has a
    marked edge."""
    while True:
        more = cut.copy()
        more[longest[cut[of_tets].any(axis=1)]] = True
        if np.array_equal(more, cut):
            return cut
        cut = more


def bisected(mesh: VolumeMesh, ends: np.ndarray) -> VolumeMesh:
    """The mesh with some edges, and all elements at these edges, cut in half.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh before the cut.
    ends : (E, 2) ndarray of int
        Corners at the ends of the edges, ascending in each row and from row to row; at most one edge of an element.

    Returns
    -------
    VolumeMesh
        Mesh of quadratic elements on the same curved walls.
    """
    corners = np.unique(mesh.tets[:, :4])
    number = np.full(len(mesh.points), -1)
    number[corners] = np.arange(len(corners))
    keys = number[ends[:, 0]] * len(corners) + number[ends[:, 1]]
    tets, barycentric, parent = _halves(number[mesh.tets[:, :4]], TET_EDGES, keys, len(corners))
    faces, _, face_parent = _halves(number[mesh.faces[:, :3]], FACE_EDGES, keys, len(corners))
    return of_pieces(mesh, tets, barycentric, parent, faces, face_parent)


def _halves(
    simplices: np.ndarray, pairs: tuple[tuple[int, int], ...], keys: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Halve the elements (or faces) that have an edge in ``keys``; the others stay whole.

    Returned are the n corners (P, n) of each of P pieces, their barycentric coordinates (P, n, n) in the parents, and
    the numbers (P,) of the parents.
    """
    ends = np.sort(simplices[:, np.array(pairs)], axis=2)
    own = ends[..., 0] * count + ends[..., 1]
    cut_edge = np.minimum(np.searchsorted(keys, own), len(keys) - 1)
    cut = keys[cut_edge] == own
    size = simplices.shape[1]
    intact, at = np.flatnonzero(~cut.any(axis=1)), np.flatnonzero(cut.any(axis=1))
    edge, row = cut[at].argmax(axis=1), np.arange(len(at))
    corners, coordinates = [simplices[intact]], [np.tile(np.eye(size), (len(intact), 1, 1))]
    for end in range(2):
        half, barycentric = simplices[at].copy(), np.tile(np.eye(size), (len(at), 1, 1))
        replaced = np.array(pairs)[edge, end]
        half[row, replaced] = count + cut_edge[at, edge]
        barycentric[row, replaced] = 0.5 * np.eye(size)[np.array(pairs)[edge]].sum(axis=1)
        corners.append(half)
        coordinates.append(barycentric)
    return np.concatenate(corners), np.concatenate(coordinates), np.concatenate([intact, at, at])


def of_pieces(
    mesh: VolumeMesh,
    tets: np.ndarray,
    barycentric: np.ndarray,
    parent: np.ndarray,
    faces: np.ndarray,
    face_parent: np.ndarray,
) -> VolumeMesh:
    """The mesh that results from dividing each element of another mesh into pieces, M pieces altogether.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh with the elements that are cut.
    tets : (M, 4) ndarray
        Corners of the pieces, numbered from 0 without gaps.
    barycentric : (M, 4, 4) ndarray
        Barycentric coordinates of each corner in the parent element.
    parent : (M,) ndarray
        Number of the parent element.
    faces, face_parent : ndarray
        (B, 3) corners of the pieces of faces, and (B,) numbers of their parents.

    Returns
    -------
    VolumeMesh
        Mesh of quadratic elements on the same curved walls.
    """
    count = int(tets.max()) + 1
    ends = np.sort(tets[:, np.array(TET_EDGES)].reshape(-1, 2), axis=1)
    key, first, middle = np.unique(ends[:, 0] * count + ends[:, 1], return_index=True, return_inverse=True)
    face_ends = np.sort(faces[:, np.array(FACE_EDGES)], axis=2)
    face_middle = np.searchsorted(key, face_ends[:, :, 0] * count + face_ends[:, :, 1])
    _, owner = np.unique(tets, return_index=True)
    middles = barycentric[:, np.array(TET_EDGES)].mean(axis=2).reshape(-1, 4)
    coordinates = np.concatenate([barycentric.reshape(-1, 4)[owner], middles[first]])
    element = np.concatenate([parent[owner // 4], parent[first // len(TET_EDGES)]])
    points = np.einsum("na,nai->ni", shape_functions(coordinates), mesh.points[mesh.tets[element]])
    return VolumeMesh(
        points,
        np.concatenate([tets, count + middle.reshape(-1, 6)], axis=1),
        np.concatenate([faces, count + face_middle], axis=1),
        mesh.face_region[face_parent],
        mesh.face_cell[face_parent],
    )
