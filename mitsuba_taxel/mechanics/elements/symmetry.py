"""Symmetric part of a pad: reduction of a mesh to the part between planes of symmetry, and expansion of its states to
the whole pad.

The common planes of symmetry (mirrors) of pad and load form a group. A symmetric state is solved on the part of the
mesh between these planes. Its stability against all displacements is tested separately: the tangent of the whole pad
decomposes into blocks, one for each irreducible representation of the group, and all blocks must be stable (J.-P.
Serre, Linear Representations of Finite Groups, chapter 2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS, Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh

CUT = 0
"""Value in place of the sign of a wall, at which displacements are free, as at a cut, and pressures are 0."""


def node_images(mesh: VolumeMesh) -> dict[Mirror, np.ndarray]:
    """The mirrors that map a mesh exactly onto itself, each with the image (N,) of each of the N nodes.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.

    Returns
    -------
    dict[Mirror, (N,) ndarray of int]
        Image node of each node, by mirror.
    """
    count = len(mesh.points)

    def lexical(points: np.ndarray) -> np.ndarray:
        return np.lexsort((points + 0.0).T)  # no negative zeros

    def cells(image: np.ndarray) -> list[np.ndarray]:
        """Node numbers of the mirrored elements and faces as sorted rows, with the regions of the faces."""
        rows = []
        for nodes, tags in ((mesh.tets[:, :4], []), (mesh.faces, [mesh.face_region])):
            ascending = np.sort(image[nodes], axis=1)
            pairs = ascending[:, ::2] * count + ascending[:, 1::2]  # one number for two nodes: there is less to sort
            numbers = np.column_stack([pairs, *tags])
            rows.append(numbers[np.lexsort(numbers.T)])
        return rows

    # A mirror image of the mesh has the same points and, with their numbers, the same elements and faces.
    order, own_cells, images = lexical(mesh.points), cells(np.arange(count)), {}
    for mirror in MIRRORS:
        image_points = mirror.image(mesh.points)
        image_order = lexical(image_points)
        if not np.array_equal(mesh.points[order], image_points[image_order]):
            continue
        image = np.empty(count, dtype=np.int64)
        image[image_order] = order
        if all(map(np.array_equal, own_cells, cells(image))):
            images[mirror] = image
    return images


@dataclass(frozen=True, eq=False)
class SymmetricPart:
    """The part of a mesh between planes of symmetry (mirrors): n of N nodes, and m elements.

    Attributes
    ----------
    mesh : VolumeMesh
        Mesh of the part.
    nodes : (n,) ndarray
        Node of the whole for each node of the part; corners come first here too.
    elements : (m,) ndarray
        Element of the whole for each element of the part.
    walls : tuple[Mirror, ...]
        The mirrors that bound it.
    group : tuple[Mirror, ...]
        The mirrors that define it.
    source : (N,) ndarray
        The node of the part of which each node of the whole is a mirror image.
    turn : (N, 3, 3) ndarray of int8
        Orthogonal matrix that maps the displacement of that node of the part to the displacement of the node of the
        whole.
    """

    mesh: VolumeMesh
    nodes: np.ndarray
    elements: np.ndarray
    walls: tuple[Mirror, ...]
    group: tuple[Mirror, ...]
    source: np.ndarray
    turn: np.ndarray

    def restrict(self, displacement: np.ndarray, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (n, 3) and pressure at the nodes of the part, from those of the whole mesh (N, 3)."""
        return displacement[self.nodes], pressure[self.nodes[: self.mesh.corner_count]]

    def expand(self, displacement: np.ndarray, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (N, 3) and pressure of the whole mesh, from those of the part (n, 3), for a symmetric state."""
        corners = self._whole_corners
        component, sign = self.components
        return sign * displacement.ravel()[component], pressure[self.source[:corners]]

    @cached_property
    def components(self) -> tuple[np.ndarray, np.ndarray]:
        """For each component of the displacement of the whole pad, the component of the displacement of the part that
        has the same magnitude: its index (N, 3) and sign (N, 3).
        """
        return 3 * self.source[:, None] + np.abs(self.turn).argmax(axis=2), self.turn.sum(axis=2, dtype=np.int8)

    def element_images(self, whole: VolumeMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The M elements of the whole mesh, each as the mirror image of an element of the part.

        Parameters
        ----------
        whole : VolumeMesh
            The whole mesh.

        Returns
        -------
        element : (M,) ndarray of int
            Element of the part for each element of the whole.
        corner : (M, 4) ndarray of int
            Corner of that element of which each corner of the element of the whole is the image.
        turn : (M, 3, 3) ndarray
            Orthogonal matrices that map vectors in the element of the part to vectors in the element of the whole.
        """
        own, corners = self.mesh.tets[:, :4], self.source[whole.tets[:, :4]]
        of_part, of_whole = (np.lexsort(np.sort(nodes, axis=1).T) for nodes in (own, corners))
        element = np.empty(len(corners), dtype=np.int64)
        element[of_whole] = np.repeat(of_part, self.copies)
        corner = (corners[:, :, None] == own[element][:, None, :]).argmax(axis=2)
        return element, corner, _turns(whole.points[whole.tets[:, :4]].mean(axis=1), self.group)

    @property
    def mirrors(self) -> int:
        """Number of mirrors whose reflections define the symmetry of the part."""
        return len(self.group)

    @property
    def copies(self) -> int:
        """Number of mirror images of the part that make up the whole pad, itself included."""
        return {0: 1, 1: 2, 2: 4, 4: 8}[self.mirrors]

    @cached_property
    def _whole_corners(self) -> int:
        return int(np.count_nonzero(self.source < self.mesh.corner_count))


def part_between(mesh: VolumeMesh, images: Mapping[Mirror, np.ndarray], mirrors: Sequence[Mirror]) -> SymmetricPart:
    """The part of a symmetric mesh on the kept sides of several mirrors.

    Parameters
    ----------
    mesh : VolumeMesh
        The whole mesh.
    images : Mapping[Mirror, ndarray]
        Images of the nodes, from :func:`node_images`.
    mirrors : Sequence[Mirror]
        A complete group.

    Returns
    -------
    SymmetricPart
        The part, with the map to the whole.
    """
    corner = mesh.points[mesh.tets[:, :4]].mean(axis=1)
    inside = np.ones(len(corner), dtype=bool)
    for mirror in mirrors:
        inside &= mirror.side(corner) > 0
    nodes = np.unique(mesh.tets[inside])
    number = np.full(len(mesh.points), -1)
    number[nodes] = np.arange(len(nodes))
    inside_faces = (number[mesh.faces] >= 0).all(axis=1)
    faces = number[mesh.faces[inside_faces]]
    part = VolumeMesh(
        mesh.points[nodes],
        number[mesh.tets[inside]],
        faces,
        mesh.face_region[inside_faces],
        mesh.face_cell[inside_faces],
    )
    source, group = np.arange(len(mesh.points)), tuple(mirror for mirror in MIRRORS if mirror in mirrors)
    position = mesh.points.copy()
    for mirror in group:
        beyond = mirror.side(position) < 0
        source[beyond] = images[mirror][source[beyond]]
        position[beyond] = mirror.image(position[beyond])
    turn, elements = _turns(mesh.points, group), np.flatnonzero(inside)
    return SymmetricPart(part, nodes, elements, _bounding(mirrors), group, number[source], turn.astype(np.int8))


def _turns(position: np.ndarray, group: Sequence[Mirror]) -> np.ndarray:
    """Orthogonal matrices (N, 3, 3) for N positions (N, 3). Each maps a vector at the mirror image of a position in the
    solved part of the pad to the vector at the position. ``group`` contains the mirrors.
    """
    turn = np.broadcast_to(np.eye(3), (len(position), 3, 3)).copy()
    for mirror in group:
        beyond = mirror.side(position) < 0
        position = np.where(beyond[:, None], mirror.image(position), position)
        turn[beyond] = turn[beyond] @ mirror.image(np.eye(3))
    return turn


def _bounding(mirrors: Sequence[Mirror]) -> tuple[Mirror, ...]:
    """Mirrors of a group whose planes bound the solved part of the pad."""
    return (ACROSS_Y, ACROSS_DIAGONAL) if len(mirrors) == len(MIRRORS) else tuple(mirrors)


def unsymmetric_blocks(mirrors: Sequence[Mirror]) -> list[tuple[Sequence[Mirror], dict[Mirror, int]]]:
    """Blocks of the tangent for displacements without the symmetry of the state; each must be checked for stability.

    A square pad has five blocks. The fifth (the two-dimensional representation of its symmetry group) is computed on
    the part between two mirrors.

    Parameters
    ----------
    mirrors : Sequence[Mirror]
        A complete group.

    Returns
    -------
    list[tuple[Sequence[Mirror], dict[Mirror, int]]]
        For each block: the mirrors of its part, and the signs at the mirror planes of the part.
    """
    walls = _bounding(mirrors)
    blocks: list[tuple[Sequence[Mirror], dict[Mirror, int]]] = []
    for bits in range(1, 2 ** len(walls)):
        blocks.append((mirrors, {wall: -1 if bits >> k & 1 else 1 for k, wall in enumerate(walls)}))
    if len(mirrors) == len(MIRRORS):
        blocks.append(((ACROSS_X, ACROSS_Y), {ACROSS_X: 1, ACROSS_Y: -1}))
    return blocks


def cut_blocks(mirrors: Sequence[Mirror]) -> list[dict[Mirror, int]]:
    """Signs of the displacements at the planes of symmetry, for a stability test of the pieces into which these planes,
    all but the last, cut the pad.

    Each displacement of the whole pad is a displacement of the pieces, and each displacement of the pieces is the sum
    of a symmetric and an antisymmetric displacement under the last mirror. The result is empty if this does not reduce
    the number of blocks.
    """
    if len(mirrors) < 2:
        return []
    *cut_walls, last = _bounding(mirrors)
    return [dict.fromkeys(cut_walls, CUT) | {last: sign} for sign in (1, -1)]
