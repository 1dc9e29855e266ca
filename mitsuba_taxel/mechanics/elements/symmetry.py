"""Reduction of a symmetric pad to a part, and expansion of its states to the whole.

The mirrors of pad and load form a group; a stable solution can be sought among symmetric states, on the part of the
mesh between their planes. Its stability against all displacements is a separate question: the tangent of the whole
decomposes into blocks, one for each irreducible representation of the group, all of which must be checked (J.-P. Serre,
Linear Representations of Finite Groups, chapter 2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS, Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh

CUT = 0
"""Instead of a sign at a wall: displacements are free there, as at a cut, and pressures at its nodes are 0."""


def node_images(mesh: VolumeMesh) -> dict[Mirror, np.ndarray]:
    """The mirrors that map a mesh onto itself exactly, each with the image (N,) of each node.

    Parameters
    ----------
    mesh : VolumeMesh
        Of the undeformed pad.

    Returns
    -------
    dict[Mirror, (N,) ndarray of int]
        By mirror, the node that is the image of each.
    """
    order, parts = _by_place(mesh.points), _parts(mesh, np.arange(len(mesh.points)))
    images = {}
    for mirror in MIRRORS:
        moved = mirror.image(mesh.points)
        other = _by_place(moved)
        if not np.array_equal(mesh.points[order], moved[other]):
            continue
        image = np.empty(len(order), dtype=np.int64)
        image[other] = order
        if all(map(np.array_equal, parts, _parts(mesh, image))):
            images[mirror] = image
    return images


def _by_place(points: np.ndarray) -> np.ndarray:
    return np.lexsort((points + 0.0).T)  # no negative zeros


def _parts(mesh: VolumeMesh, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Images of elements and of faces with their regions, as rows of numbers in ascending order."""
    elements, faces = (_paired(image[nodes], len(image)) for nodes in (mesh.tets[:, :4], mesh.faces))
    return _ordered(elements), _ordered(np.column_stack([faces, mesh.face_region]))


def _paired(nodes: np.ndarray, count: int) -> np.ndarray:
    """One number for every two of the ascending nodes of each row: there is less to sort."""
    nodes = np.sort(nodes, axis=1)
    return nodes[:, ::2] * count + nodes[:, 1::2]


def _ordered(rows: np.ndarray) -> np.ndarray:
    return rows[np.lexsort(rows.T)]


@dataclass(frozen=True, eq=False)
class SymmetricPart:
    """The part of a mesh on the kept side of some mirrors.

    Attributes
    ----------
    mesh : VolumeMesh
        Of the part.
    nodes : (n,) ndarray
        Node of the whole for each node of the part; corners come first here too.
    elements : (m,) ndarray
        Element of the whole for each element of the part.
    walls : tuple[Mirror, ...]
        The mirrors that bound it.
    group : tuple[Mirror, ...]
        The mirrors that define it.
    source : (N,) ndarray
        Node of the part of which each node of the whole is an image.
    turn : (N, 3, 3) ndarray
        Orthogonal matrix from the displacement there to that of the node of the whole.
    """

    mesh: VolumeMesh
    nodes: np.ndarray
    elements: np.ndarray
    walls: tuple[Mirror, ...]
    group: tuple[Mirror, ...]
    source: np.ndarray
    turn: np.ndarray

    def restrict(self, displacement: np.ndarray, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement and pressure on the part, from those of the whole."""
        return displacement[self.nodes], pressure[self.nodes[: self.mesh.corner_count]]

    def expand(self, displacement: np.ndarray, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement and pressure of the whole, from those of a symmetric state of the part."""
        corners = self._whole_corners
        place, sign = self.components
        return sign * displacement.ravel()[place], pressure[self.source[:corners]]

    @cached_property
    def components(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) component of a displacement of the part for each of the whole, and its sign: mirrors permute them."""
        return 3 * self.source[:, None] + np.abs(self.turn).argmax(axis=2), self.turn.sum(axis=2)

    def element_images(self, whole: VolumeMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of the elements of the whole: (M,) the element of the part of which each is an image, (M, 4) the same for its
        corners, and (M, 3, 3) matrices that transform vectors there into its own."""
        own, corners = self.mesh.tets[:, :4], self.source[whole.tets[:, :4]]
        of_part, of_whole = (np.lexsort(np.sort(nodes, axis=1).T) for nodes in (own, corners))
        element = np.empty(len(corners), dtype=np.int64)
        element[of_whole] = np.repeat(of_part, self.copies)
        corner = (corners[:, :, None] == own[element][:, None, :]).argmax(axis=2)
        return element, corner, _turns(whole.points[whole.tets[:, :4]].mean(axis=1), self.group)

    @property
    def mirrors(self) -> int:
        """Number of mirrors of the group."""
        return len(self.group)

    @property
    def copies(self) -> int:
        """Number of images of the part in the whole."""
        return {0: 1, 1: 2, 2: 4, 4: 8}[self.mirrors]

    @cached_property
    def _whole_corners(self) -> int:
        return int(np.count_nonzero(self.source < self.mesh.corner_count))


def part_between(mesh: VolumeMesh, images: Mapping[Mirror, np.ndarray], mirrors: Sequence[Mirror]) -> SymmetricPart:
    """The part of a symmetric mesh that ``mirrors``, a complete group, define; ``images`` from node_images."""
    corner = mesh.points[mesh.tets[:, :4]].mean(axis=1)
    inside = np.ones(len(corner), dtype=bool)
    for mirror in mirrors:
        inside &= mirror.side(corner) > 0
    nodes = np.unique(mesh.tets[inside])
    number = np.full(len(mesh.points), -1)
    number[nodes] = np.arange(len(nodes))
    kept = (number[mesh.faces] >= 0).all(axis=1)
    faces = number[mesh.faces[kept]]
    part = VolumeMesh(
        mesh.points[nodes], number[mesh.tets[inside]], faces, mesh.face_region[kept], mesh.face_cell[kept]
    )
    source, group = np.arange(len(mesh.points)), tuple(mirror for mirror in MIRRORS if mirror in mirrors)
    position = mesh.points.copy()
    for mirror in group:
        beyond = mirror.side(position) < 0
        source[beyond] = images[mirror][source[beyond]]
        position[beyond] = mirror.image(position[beyond])
    turn, elements = _turns(mesh.points, group), np.flatnonzero(inside)
    return SymmetricPart(part, nodes, elements, _bounding(mirrors), group, number[source], turn)


def _turns(position: np.ndarray, group: Sequence[Mirror]) -> np.ndarray:
    """(N, 3, 3) matrices that transform vectors at the image on the kept side of a group into those at each position
    (N, 3)."""
    turn = np.broadcast_to(np.eye(3), (len(position), 3, 3)).copy()
    for mirror in group:
        beyond = mirror.side(position) < 0
        position = np.where(beyond[:, None], mirror.image(position), position)
        turn[beyond] = turn[beyond] @ mirror.image(np.eye(3))
    return turn


def _bounding(mirrors: Sequence[Mirror]) -> tuple[Mirror, ...]:
    """Those of a group whose planes bound the kept part."""
    return (ACROSS_Y, ACROSS_DIAGONAL) if len(mirrors) == len(MIRRORS) else tuple(mirrors)


def unsymmetric_blocks(mirrors: Sequence[Mirror]) -> list[tuple[Sequence[Mirror], dict[Mirror, int]]]:
    """The blocks of the tangent apart from that of symmetric states: mirrors of a part, and signs at its walls.

    The fifth block of a square pad, of its two-dimensional representation, needs the part between two mirrors.
    """
    walls = _bounding(mirrors)
    blocks: list[tuple[Sequence[Mirror], dict[Mirror, int]]] = []
    for bits in range(1, 2 ** len(walls)):
        blocks.append((mirrors, {wall: -1 if bits >> k & 1 else 1 for k, wall in enumerate(walls)}))
    if len(mirrors) == len(MIRRORS):
        blocks.append(((ACROSS_X, ACROSS_Y), {ACROSS_X: 1, ACROSS_Y: -1}))
    return blocks


def cut_blocks(mirrors: Sequence[Mirror]) -> list[dict[Mirror, int]]:
    """Signs at the walls of the part, for pieces between cuts along some of the mirrors' planes.

    A displacement of the whole without symmetry is one of pieces with the mirror of the last wall, the sum of a
    symmetric and an antisymmetric one. Empty if this does not reduce the number of blocks.
    """
    if len(mirrors) < 2:
        return []
    *others, kept = _bounding(mirrors)
    return [dict.fromkeys(others, CUT) | {kept: sign} for sign in (1, -1)]
