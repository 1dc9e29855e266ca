"""Detection of contact of the deformed pad with itself, the board or a package, which the mechanics does not model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, triu
from scipy.spatial.transform import Rotation

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.bezier_patches import Place, bulge, control_points, first_touch, quarters
from mitsuba_taxel.geometry.surfaces.box_tree import BoxTree, Level
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.bodies import body_of_each
from mitsuba_taxel.mechanics.contact.barriers.singular_edges import STRIP, beyond_strip
from mitsuba_taxel.pads.regions import REGIONS

FRINGE = 0.05
"""Uncertainty of the border of the strip beside singular edges, relative to its width."""

TOUCHING = 1e-10
"""Distance that counts as contact, relative to the pad's longest side: more than rounding."""

PACKAGE = "a package"

_ASKEW = Rotation.from_rotvec([0.31, 0.53, 0.71]).as_matrix()
"""Rotation of points before rays are cast along z, so that rays avoid edges and corners of geometry aligned with the
axes."""


@dataclass(frozen=True)
class Contact:
    """A point at which the pad touches an object, and the name of that object.

    Attributes
    ----------
    what : str
        "itself", "the board" or "a package".
    place : Place
        Point of contact in mm, in the deformed pad.
    """

    what: str
    place: Place


class ContactTest:
    """Test of the deformed states of a mesh for contact.

    Curved faces are tested, rather than flat triangles: two faces are subdivided until they are certainly separate, or
    touch to within `TOUCHING`. The pad touches the board where a face that is not glued to it goes below z = 0. Within
    the `STRIP` beside singular edges the surface may fold onto itself, and go below the board by the width of the
    strip. A single face that intersects itself is found by the test for inverted elements.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    obstacles : (K, 3, 3) ndarray, optional
        Corners of the triangles of closed surfaces, in mm: the packages in the cells.
    nodes : (n,) ndarray, optional
        Nodes to which the test is limited. Contact with the board is tested on faces that have only such nodes, and
        contact of two faces if one of them has only such nodes. Contact with obstacles is tested everywhere.

    Raises
    ------
    InputError
        if ``obstacles`` are not triangles of finite numbers.
    """

    def __init__(self, mesh: VolumeMesh, obstacles: np.ndarray | None = None, nodes: np.ndarray | None = None) -> None:
        self._points, self._faces = mesh.points, mesh.faces
        self._tolerance = TOUCHING * float(np.ptp(mesh.points, axis=0).max())
        self._tree = BoxTree(mesh.points[mesh.faces[:, :3]].mean(axis=1))
        self._obstacles = None if obstacles is None else _Obstacles(obstacles)

        is_chosen = np.isin(mesh.faces, np.arange(len(mesh.points)) if nodes is None else nodes)
        self._chosen = np.asarray(is_chosen.all(axis=1))
        self._over_board = mesh.faces[self._chosen & (mesh.face_region != REGIONS["bottom"])]
        self._beyond = control_points(beyond_strip(mesh)[:, None], mesh.faces)
        self._strip = STRIP * float(np.ptp(mesh.points[:, 2]))

    def find(self, displacement: np.ndarray) -> Contact | None:
        """Find a contact of the deformed pad with the board, a package or itself.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement of the nodes, mm.

        Returns
        -------
        Contact or None
            The first contact that is found: with the board, a package, or the pad itself; None without.
        """
        control = np.concatenate([control_points(self._points + displacement, self._faces), self._beyond])
        place = _first_below(control[:, self._over_board.T], self._strip, self._tolerance)
        if place:
            return Contact("the board", place)
        contact = self.find_package(displacement)
        if contact:
            return contact
        place = self._on_itself(control)
        return Contact("itself", place) if place else None

    def find_fold(self, displacement: np.ndarray) -> Place | None:
        """A point in mm at which the pad intersects itself, including the strip beside singular edges; None if it does
        not intersect itself."""
        control = control_points(self._points + displacement, self._faces)
        return self._on_itself(np.concatenate([control, np.ones_like(self._beyond)]))

    def find_package(self, displacement: np.ndarray) -> Contact | None:
        """Find a contact of the deformed pad with a package; see :meth:`find`."""
        if not self._obstacles:
            return None
        patches = control_points(self._points + displacement, self._faces)[:, self._faces.T]
        place = self._on_obstacle(self._obstacles, patches, self._levels(patches))
        return Contact(PACKAGE, place) if place else None

    @cached_property
    def at_rest(self) -> Contact | None:
        """Find a contact of the undeformed pad with the board, a package or itself; None if there is none."""
        return self.find(np.zeros_like(self._points))

    @cached_property
    def _neighbours(self) -> _Neighbours:
        return _Neighbours(self._faces, self._chosen)

    def _levels(self, patches: np.ndarray) -> list[Level]:
        return self._tree.levels(*_boxes(patches, self._tolerance))

    def _on_obstacle(self, obstacles: _Obstacles, patches: np.ndarray, boxes: list[Level]) -> Place | None:
        pad_faces, obstacle_faces = self._tree.overlapping_with(boxes, obstacles.tree, obstacles.boxes)
        touching = [
            np.pad(patch, ((0, 1), (0, 0), (0, 0)), constant_values=1.0)
            for patch in (patches[:, :, pad_faces], obstacles.patches[:, :, obstacle_faces])
        ]
        place = first_touch(touching[0], touching[1], "nothing", self._tolerance)
        return place or obstacles.point_within(patches, self._tree)

    def _on_itself(self, control: np.ndarray) -> Place | None:
        first, second = self._neighbours.without(*self._close(control[:3, self._faces.T]))
        pairs = {"nothing": (self._faces[first], self._faces[second]), **self._neighbours.pairs}
        for shared, (nodes, other_nodes) in pairs.items():
            place = first_touch(control[:, nodes.T], control[:, other_nodes.T], shared, self._tolerance)
            if place:
                return place
        return None

    def _close(self, patches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of faces whose bounding boxes overlap, each pair once: the numbers of its first and of its second face.
        Pairs of two untested faces are left out."""
        levels = self._levels(patches)
        if self._chosen.all():
            return self._tree.overlapping(levels)
        numbers, tree = self._chosen_tree
        boxes = tree.levels(*_boxes(patches[:, :, numbers], self._tolerance))
        first, second = tree.overlapping_with(boxes, self._tree, levels)
        first = numbers[first]
        unique = ~self._chosen[second] | (first < second)
        return first[unique], second[unique]

    @cached_property
    def _chosen_tree(self) -> tuple[np.ndarray, BoxTree]:
        """Numbers of the tested faces, and their search tree."""
        numbers = np.flatnonzero(self._chosen)
        return numbers, BoxTree(self._points[self._faces[numbers, :3]].mean(axis=1))


class _Neighbours:
    """Pairs of faces that share a vertex or an edge.

    Parameters
    ----------
    faces : (F, 6) ndarray
        Nodes of the faces.
    chosen : (F,) ndarray of bool
        Whether each face is tested; pairs of two other faces are left out of ``pairs``.

    Attributes
    ----------
    pairs : dict[str, tuple[ndarray, ndarray]]
        For the keys "vertex" and "edge": the nodes (n, 6) of the first and of the second face of each of n pairs,
        numbered from the shared vertex or edge.
    """

    def __init__(self, faces: np.ndarray, chosen: np.ndarray) -> None:
        self._count = len(faces)
        number = np.arange(self._count).repeat(3)
        corners = coo_array((np.ones(len(number), dtype=np.int8), (number, faces[:, :3].ravel()))).tocsr()
        shared = triu(corners @ corners.T, k=1).tocoo()
        first, second = shared.coords[0].astype(np.int64), shared.coords[1].astype(np.int64)
        self._keys = np.sort(first * self._count + second)

        relevant = chosen[first] | chosen[second]
        first, second, at_vertex = first[relevant], second[relevant], shared.data[relevant] == 1
        first_nodes, second_nodes = faces[first[at_vertex]], faces[second[at_vertex]]
        i, j = _common_columns(first_nodes[:, :3], second_nodes[:, :3])
        vertex = _rotated(first_nodes, i), _rotated(second_nodes, j)
        first_nodes, second_nodes = faces[first[~at_vertex]], faces[second[~at_vertex]]
        i, j = _common_columns(first_nodes[:, 3:], second_nodes[:, 3:])
        edge = _rotated(first_nodes, i), _rotated(second_nodes, j)[:, [1, 0, 2, 3, 5, 4]]
        self.pairs = {"vertex": vertex, "edge": edge}

    def without(self, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Remove pairs of adjacent faces from a list of pairs. Returns the first and the second face of each remaining
        pair; the two faces share neither a vertex nor an edge.
        """
        keys = np.minimum(first, second) * self._count + np.maximum(first, second)
        separate = self._keys[np.searchsorted(self._keys, keys) % len(self._keys)] != keys
        return first[separate], second[separate]


def _common_columns(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position of the node that two triples of nodes share: for each row i, the column (n,) of that node in ``first``
    (n, 3), and its column (n,) in ``second`` (n, 3)."""
    i, j = np.divmod((first[:, :, None] == second[:, None]).reshape(-1, 9).argmax(axis=1), 3)
    return i, j


def _rotated(faces: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Nodes (n, 6) of n faces, renumbered cyclically so that the corner ``first`` (n,) of each face comes first."""
    corners = (first[:, None] + np.arange(3)) % 3
    return np.take_along_axis(faces, np.concatenate([corners, 3 + corners], axis=1), axis=1)


class _Obstacles:
    """Closed surfaces of rigid obstacles, as K flat six-node patches (3, 6, K)."""

    def __init__(self, triangles: np.ndarray) -> None:
        triangles = np.asarray(triangles, dtype=float)
        if triangles.shape[1:] != (3, 3) or not len(triangles) or not np.all(np.isfinite(triangles)):
            raise InputError(
                f"obstacles = an array of shape {triangles.shape} is not allowed: (K, 3, 3) finite numbers are needed."
            )
        corners = triangles.transpose(2, 1, 0)
        self.patches = np.concatenate([corners, (corners + corners[:, [1, 2, 0]]) / 2], axis=1)
        self._centres = corners.mean(axis=1)
        self.tree = BoxTree(self._centres.T)
        self.boxes = self.tree.levels(*_boxes(self.patches, 0.0))
        self._body = body_of_each(triangles)
        count = np.bincount(self._body)
        middles = np.stack([np.bincount(self._body, column) / count for column in self._centres[:2]])
        outwards = np.lexsort((np.linalg.norm(self._centres[:2] - middles[:, self._body], axis=0), self._body))
        self._inner = self._centres[:, outwards[np.cumsum(count) - count]]  # those nearest to the middle

    def point_within(self, patches: np.ndarray, tree: BoxTree) -> Place | None:
        """A point in mm of a body inside the pad, or of the pad inside a body; None if there is none.

        The surfaces do not intersect, so that all triangles of a body are on the same side. A majority decides, because
        a point close to a curved face may be on the wrong side of its flat pieces.
        """
        if not _free_below(self._inner, patches).all():
            votes = np.bincount(self._body, _within(self._centres, patches, tree)) / np.bincount(self._body)
            if votes.max() > 0.5:
                x, y, z = self._centres[:, np.argmax(self._body == votes.argmax())]
                return float(x), float(y), float(z)
        corner = patches[:, :1, 0]
        if not _free_below(corner, self.patches).all() and _within(corner, self.patches, self.tree).any():
            x, y, z = patches[:, 0, 0]
            return float(x), float(y), float(z)
        return None


def _free_below(points: np.ndarray, patches: np.ndarray) -> np.ndarray:
    """Mask (K,): True for each of K ``points`` (3, K) below which there is certainly no surface patch. Such a point
    is outside."""
    low, high = patches.min(axis=1)[:, None], patches.max(axis=1)[:, None]
    x, y, z = points[:, :, None]
    beside = (x < low[0]) | (x > high[0]) | (y < low[1]) | (y > high[1])
    return (beside | (z < low[2])).all(axis=1)


def _within(points: np.ndarray, patches: np.ndarray, tree: BoxTree) -> np.ndarray:
    """Mask (K,): whether each of K ``points`` (3, K) is inside the closed surface of ``patches``.

    A ray from an inner point crosses the surface an odd number of times. Each patch that the ray may meet is
    approximated by 16 flat triangles.
    """
    points, patches = _ASKEW @ points, np.tensordot(_ASKEW, patches, axes=(1, 0))
    rays = BoxTree(points.T)
    ends = np.concatenate([points[:2], np.full((1, points.shape[1]), np.inf)])
    met, ray = tree.overlapping_with(tree.levels(*_boxes(patches, 0.0)), rays, rays.levels(points.T, ends.T))
    corners = quarters(quarters(patches[:, :, met]))[:, :3] - np.tile(points[:, ray], 16)[:, None]
    x, y, z = corners
    beside = x * y[[1, 2, 0]] - x[[1, 2, 0]] * y
    area = beside.sum(axis=0)
    above = (beside * z[[2, 0, 1]]).sum(axis=0) * area > 0
    crossed = ((beside > 0).all(axis=0) | (beside < 0).all(axis=0)) & above
    return np.bincount(np.tile(ray, 16), crossed, minlength=points.shape[1]) % 2 == 1


def _boxes(patches: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corners (n, 3) of bounding boxes of n patches, with a margin in mm."""
    return patches.min(axis=1).T - margin, patches.max(axis=1).T + margin


def _first_below(patches: np.ndarray, strip: float, tolerance: float) -> Place | None:
    """A point at which one of n patches (4, 6, n) is below the board; None if there is none.

    The fourth coordinate is the distance from the strip beside singular edges. Where it is positive, a point is below
    the board if its height is at most ``tolerance``, elsewhere if it is at most -``strip``. Patches are subdivided
    until this is decided.
    """
    while patches.size:
        below = (patches[2, :3] <= np.where(patches[3, :3] > 0, tolerance, -strip)).any(axis=0)
        if below.any():
            first = patches[:3, :3, below.argmax()]
            x, y, z = first[:, first[2].argmin()]
            return float(x), float(y), float(z)
        beyond = patches[3].max(axis=0) > 0
        mixed = beyond & (patches[3].min(axis=0) < -FRINGE * strip)
        undecided = (patches[2].min(axis=0) <= np.where(beyond, tolerance, -strip)) & (
            mixed | (bulge(patches[:3]) > tolerance)
        )
        patches = quarters(patches[:, :, undecided])
    return None
