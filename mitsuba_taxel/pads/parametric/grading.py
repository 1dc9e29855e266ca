"""Anisotropic refinement: thin layers of elements along the edges where the stress is singular.

Near a re-entrant or a glued edge the error depends on the size of the elements across the edge, hardly on the size
along it (T. Apel, Anisotropic Finite Elements, 1999). So the elements at the edge are cut across and left long."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np

from mitsuba_taxel.geometry.refinement import of_pieces
from mitsuba_taxel.geometry.unique_rows import unique_rows
from mitsuba_taxel.geometry.volume_mesh import TET_EDGES, VolumeMesh

_TET_CUTS = {1: ((0, 1), (0, 2), (0, 3)), 2: ((0, 2), (0, 3), (1, 2), (1, 3)), 3: ((0, 3), (1, 3), (2, 3))}
"""Edges of a tetrahedron that are cut, if its first 1, 2 or 3 corners are singular; the cuts are its nodes 4, 5, ..."""
_TET_PIECES = {
    1: ((0, 4, 5, 6), (4, 5, 6, 1, 2, 3)),
    2: ((0, 4, 5, 1, 6, 7), (2, 4, 6, 3, 5, 7)),
    3: ((4, 5, 6, 3), (0, 1, 2, 4, 5, 6)),
}
"""The resulting tetrahedra and prisms; the two triangles of a prism have the same orientation, towards the second."""
_FACE_CUTS = {1: ((0, 1), (0, 2)), 2: ((0, 2), (1, 2))}
_FACE_PIECES = {1: ((0, 3, 4), (3, 1, 2, 4)), 2: ((3, 4, 2), (0, 1, 4, 3))}
"""The resulting triangles and quadrangles of a triangle."""
_PRISM_FROM = np.array(
    [
        [0, 1, 2, 3, 4, 5],
        [1, 2, 0, 4, 5, 3],
        [2, 0, 1, 5, 3, 4],
        [3, 5, 4, 0, 2, 1],
        [4, 3, 5, 1, 0, 2],
        [5, 4, 3, 2, 1, 0],
    ]
)
_PRISM_TETS = np.array([[[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]], [[0, 1, 2, 4], [0, 4, 2, 5], [0, 4, 5, 3]]])


def cut_towards(
    mesh: VolumeMesh, singular: np.ndarray, fraction: float | Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> VolumeMesh:
    """Cut every edge of a mesh that has exactly one singular end.

    Elements are cut into tetrahedra and prisms, and the prisms into three tetrahedra each, with the diagonals that
    start at the node of the lowest number, so that neighbours agree (J. Dompierre et al., How to subdivide pyramids,
    prisms and hexahedra into tetrahedra, 1999). New nodes lie on the curved elements: the solid is unchanged.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the pad.
    singular : (N,) ndarray of bool
        Mask of the singular nodes.
    fraction : float or Callable
        Position of the cut on an edge, relative to its length, from the singular end; or a function that returns the
        positions (E,) of all cuts from the nodes (E,) at the singular ends of edges, and from those at the other ends.

    Returns
    -------
    VolumeMesh
        Mesh with the same nodes, and new ones.
    """
    corners = np.unique(mesh.tets[:, :4])
    number = np.full(len(mesh.points), -1)
    number[corners] = np.arange(len(corners))
    tets, faces, is_singular = number[mesh.tets[:, :4]], number[mesh.faces[:, :3]], singular[corners]
    edges = np.sort(tets[:, np.array(TET_EDGES)].reshape(-1, 2), axis=1)
    edges = edges[unique_rows(edges)[0]]
    edges = edges[is_singular[edges].sum(axis=1) == 1]
    near, far = corners[np.where(is_singular[edges[:, :1]], edges, edges[:, ::-1])].T
    fractions = fraction(near, far) if callable(fraction) else np.full(len(edges), fraction)
    cut = _CutEdges(is_singular, edges, fractions)
    tets, tet_coordinates, parent = cut.pieces(tets, _TET_CUTS, _TET_PIECES)
    faces, _, face_parent = cut.pieces(faces, _FACE_CUTS, _FACE_PIECES)
    return of_pieces(mesh, tets, tet_coordinates, parent, faces, face_parent)


class _CutEdges:
    """Cuts of elements on E edges (E, 2). Each edge has one ``singular`` end, and is cut at a fraction (E,) of its
    length from this end."""

    def __init__(self, singular: np.ndarray, edges: np.ndarray, fraction: np.ndarray) -> None:
        self.singular, self.edges, self.fraction = singular, edges, fraction
        self._key = edges[:, 0] * len(singular) + edges[:, 1]

    def pieces(self, simplices: np.ndarray, cuts: dict, shapes: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cut tetrahedra or triangles into smaller ones at given edges.

        Parameters
        ----------
        simplices : (M, n) ndarray of int
            Corners.
        cuts, shapes : dict
            Cuts and shapes by the number of singular corners: the edges that are cut, and the resulting pieces.

        Returns
        -------
        corners : (P, n) ndarray of int
            Corners of the pieces.
        coordinates : (P, n, n) ndarray
            Barycentric coordinates of these corners in the parent.
        parents : (P,) ndarray of int
            Number of the simplex that each piece is part of.
        """
        size = simplices.shape[1]
        singular = self.singular[simplices]
        count = singular.sum(axis=1)
        uncut = np.flatnonzero((count == 0) | (count == size))
        corners, coordinates, parents = [simplices[uncut]], [np.tile(np.eye(size), (len(uncut), 1, 1))], [uncut]
        for singulars, pairs in cuts.items():
            parent = np.flatnonzero(count == singulars)
            order = _singular_first(singular[parent])
            corner_nodes = np.take_along_axis(simplices[parent], order, axis=1)
            start, end = np.array(pairs).T
            ends = np.sort(corner_nodes[:, np.array(pairs)], axis=2)
            key = ends[:, :, 0] * len(self.singular) + ends[:, :, 1]
            cut_edges = np.searchsorted(self._key, key)
            cut_nodes, fraction = len(self.singular) + cut_edges, self.fraction[cut_edges][:, :, None]
            nodes = np.concatenate([corner_nodes, cut_nodes], axis=1)
            at_corners = np.eye(size)[order]
            at_cuts = (1 - fraction) * at_corners[:, start] + fraction * at_corners[:, end]
            node_coordinates = np.concatenate([at_corners, at_cuts], axis=1)
            for shape in shapes[singulars]:
                local = _simplices(nodes[:, shape], np.array(shape), size)
                number = local.shape[1]
                local = local.reshape(-1, size)
                owner = np.repeat(np.arange(len(parent)), number)
                corners.append(nodes[owner[:, None], local])
                coordinates.append(node_coordinates[owner[:, None], local])
                parents.append(parent[owner])
        return np.concatenate(corners), np.concatenate(coordinates), np.concatenate(parents)


def _singular_first(singular: np.ndarray) -> np.ndarray:
    """Reorder the corners of elements by even permutations (M, n), so that the corners marked in ``singular`` (M, n)
    come first."""
    size = singular.shape[1]
    even_permutations = [p for p in permutations(range(size)) if np.linalg.det(np.eye(size)[list(p)]) > 0]
    table = np.zeros((2**size, size), dtype=np.int64)
    for code in range(2**size):
        flags = [bool(code >> k & 1) for k in range(size)]
        table[code] = next(p for p in even_permutations if [flags[k] for k in p] == sorted(flags, reverse=True))
    return table[singular @ (1 << np.arange(size))]


def _simplices(nodes: np.ndarray, shape: np.ndarray, size: int) -> np.ndarray:
    """Corners (M, pieces, size), as numbers in ``shape``, of the simplices into which M tetrahedra, prisms, triangles
    or quadrangles with ``nodes`` are divided."""
    if nodes.shape[1] == size:
        return np.broadcast_to(shape, (len(nodes), 1, size))
    lowest = nodes.argmin(axis=1)
    if size == 3:
        rotation = (lowest[:, None] + np.arange(4)) % 4
        return shape[rotation[:, [[0, 1, 2], [0, 2, 3]]]]
    rotation = _PRISM_FROM[lowest]
    rotated = np.take_along_axis(nodes, rotation, axis=1)
    second_diagonal = rotated[:, [2, 4]].min(axis=1) < rotated[:, [1, 5]].min(axis=1)
    tets = _PRISM_TETS[second_diagonal.astype(np.int64)]
    return shape[np.take_along_axis(rotation[:, None], tets, axis=2)]
