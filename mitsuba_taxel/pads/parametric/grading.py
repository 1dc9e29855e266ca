"""Anisotropic refinement: thin layers of elements along the edges where the stress is singular.

Near a re-entrant or a glued edge the error depends on the size of the elements across the edge, hardly on that along it
(T. Apel, Anisotropic Finite Elements, 1999). So the elements at the edge are cut across and left long.
"""

from __future__ import annotations

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


def cut_towards(mesh: VolumeMesh, singular: np.ndarray, fraction: float) -> VolumeMesh:
    """The mesh with every edge that has one end among the ``singular`` nodes (N,) cut at ``fraction`` from that end.

    Elements are cut into tetrahedra and prisms, and these into three tetrahedra with the diagonals from the node of the
    lowest number, so that neighbours agree (J. Dompierre et al., How to subdivide pyramids, prisms and hexahedra into
    tetrahedra, 1999). New nodes lie on the curved elements: the solid is unchanged.
    """
    corners = np.unique(mesh.tets[:, :4])
    number = np.full(len(mesh.points), -1)
    number[corners] = np.arange(len(corners))
    tets, faces, at = number[mesh.tets[:, :4]], number[mesh.faces[:, :3]], singular[corners]
    edges = np.sort(tets[:, np.array(TET_EDGES)].reshape(-1, 2), axis=1)
    edges = edges[unique_rows(edges)[0]]
    cut = _Cut(at, edges[at[edges].sum(axis=1) == 1], fraction)
    tets, tet_place, parent = cut.pieces(tets, _TET_CUTS, _TET_PIECES)
    faces, _, face_parent = cut.pieces(faces, _FACE_CUTS, _FACE_PIECES)
    return of_pieces(mesh, tets, tet_place, parent, faces, face_parent)


class _Cut:
    """Simplices cut on the edges (E, 2) that have one of the ``singular`` corners at one end."""

    def __init__(self, singular: np.ndarray, edges: np.ndarray, fraction: float) -> None:
        self.singular, self.edges, self.fraction = singular, edges, fraction
        self._key = edges[:, 0] * len(singular) + edges[:, 1]

    def pieces(self, simplices: np.ndarray, cuts: dict, shapes: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Corners (P, n) of the pieces of ``simplices`` (M, n), barycentric coordinates (P, n, n), and parents (P,)."""
        size = simplices.shape[1]
        singular = self.singular[simplices]
        count = singular.sum(axis=1)
        whole = np.flatnonzero((count == 0) | (count == size))
        corners, places, parents = [simplices[whole]], [np.tile(np.eye(size), (len(whole), 1, 1))], [whole]
        for singulars, pairs in cuts.items():
            parent = np.flatnonzero(count == singulars)
            order = _singular_first(singular[parent])
            own = np.take_along_axis(simplices[parent], order, axis=1)
            start, end = np.array(pairs).T
            ends = np.sort(own[:, np.array(pairs)], axis=2)
            new = len(self.singular) + np.searchsorted(self._key, ends[:, :, 0] * len(self.singular) + ends[:, :, 1])
            nodes = np.concatenate([own, new], axis=1)
            unit = np.eye(size)[order]
            place = np.concatenate([unit, (1 - self.fraction) * unit[:, start] + self.fraction * unit[:, end]], axis=1)
            for shape in shapes[singulars]:
                local = _simplices(nodes[:, shape], np.array(shape), size)
                number = local.shape[1]
                local = local.reshape(-1, size)
                owner = np.repeat(np.arange(len(parent)), number)
                corners.append(nodes[owner[:, None], local])
                places.append(place[owner[:, None], local])
                parents.append(parent[owner])
        return np.concatenate(corners), np.concatenate(places), np.concatenate(parents)


def _singular_first(singular: np.ndarray) -> np.ndarray:
    """Even permutations (M, n) of the corners of simplices that put the singular ones (M, n) first."""
    size = singular.shape[1]
    even = [p for p in permutations(range(size)) if np.linalg.det(np.eye(size)[list(p)]) > 0]
    table = np.zeros((2**size, size), dtype=np.int64)
    for code in range(2**size):
        marked = [bool(code >> k & 1) for k in range(size)]
        table[code] = next(p for p in even if [marked[k] for k in p] == sorted(marked, reverse=True))
    return table[singular @ (1 << np.arange(size))]


def _simplices(nodes: np.ndarray, shape: np.ndarray, size: int) -> np.ndarray:
    """Corners (M, pieces, size) of the simplices that each piece with ``nodes`` is cut into, as ``shape`` lists
    them."""
    if nodes.shape[1] == size:
        return np.broadcast_to(shape, (len(nodes), 1, size))
    lowest = nodes.argmin(axis=1)
    if size == 3:
        turned = (lowest[:, None] + np.arange(4)) % 4
        return shape[turned[:, [[0, 1, 2], [0, 2, 3]]]]
    turned = _PRISM_FROM[lowest]
    own = np.take_along_axis(nodes, turned, axis=1)
    other = own[:, [2, 4]].min(axis=1) < own[:, [1, 5]].min(axis=1)
    tets = _PRISM_TETS[other.astype(np.int64)]
    return shape[np.take_along_axis(turned[:, None], tets, axis=2)]
