"""Forces that keep a pad off rigid bodies, from the potential of :mod:`.barrier`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.geometry.surfaces.box_tree import BoxTree, Level
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.barrier import (
    APPROACH,
    REACH,
    REACH_AT_REST,
    additive_ccd,
)
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.ipc_toolkit import ipctk_of_one_thread
from mitsuba_taxel.mechanics.cutting import cut_faces
from mitsuba_taxel.pads.regions import REGIONS

CUTS = 6
"""Number of triangles along the longest edge of a face: as many as for light transport by default."""


class BodyBarrier:
    """Repulsion of the surface of a pad, except its glued bottom, from rigid bodies.

    Faces are cut as for light transport, into triangles so small that curved faces deviate from them by less than the
    reach. Contact of the pad with itself is the task of :class:`Barrier`.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the whole undeformed pad, which touches no body.
    modulus : float
        Modulus that scales the repulsion, in MPa; see :class:`Barrier`.
    bodies : RigidBodies
        The bodies.
    fraction : float
        Reach of the repulsion, relative to the default.

    Attributes
    ----------
    reach : float
        Largest distance at which bodies repel the pad, mm.

    Raises
    ------
    InputError
        without `ipctk`.
    """

    def __init__(self, mesh: VolumeMesh, modulus: float, bodies: RigidBodies, fraction: float = 1.0) -> None:
        self._ipc = ipc = ipctk_of_one_thread()
        cells = np.unique(mesh.face_cell[mesh.face_cell > 0])
        cut = cut_faces(mesh, CUTS, tuple(cells.tolist()))
        wall_triangles = cut.triangles[mesh.face_region[cut.faces] != REGIONS["bottom"]]
        used_vertices, number = np.unique(wall_triangles, return_inverse=True)
        point = cut.of_vertex[used_vertices]
        entries = cut.weights[point].ravel(), (np.arange(len(used_vertices)).repeat(6), cut.nodes[point].ravel())
        self._interpolation = sparse.csr_array(entries, shape=(len(used_vertices), len(mesh.points)))
        self._points = mesh.points
        self._corners, of_bodies = bodies.surface

        self._pad_facets = _Facets(number.reshape(-1, 3), 0, 0, 0)
        counts = len(used_vertices), len(self._pad_facets.sides), len(self._pad_facets.triangles)
        fixed = _Facets(of_bodies, *counts)
        self._fixed = {kind: _Fixed.of(*boxes) for kind, boxes in fixed.boxes(self._corners, self._corners).items()}
        positions = self._places(np.zeros_like(mesh.points))
        sides, triangles = (
            np.concatenate([getattr(self._pad_facets, field), len(used_vertices) + getattr(fixed, field)])
            for field in ("sides", "triangles")
        )
        self._mesh = ipc.CollisionMesh(positions, np.asfortranarray(sides), np.asfortranarray(triangles))
        self._last: tuple[np.ndarray, Any] = np.empty(0), None
        self.reach = REACH / REACH_AT_REST * float(np.ptp(mesh.points[:, 2]))  # for the search in gap()
        self.reach = fraction * REACH_AT_REST * self.gap(np.zeros_like(mesh.points))
        self._last = np.empty(0), None  # of another reach
        self._potential = ipc.BarrierPotential(self.reach, modulus, True)
        self._ccd = additive_ccd(ipc)

    def gap(self, displacement: np.ndarray) -> float:
        """Smallest distance in mm of the pad from a body, at most the reach."""
        positions, collisions = self._near(displacement)
        return (
            float(np.sqrt(collisions.compute_minimum_distance(self._mesh, positions)))
            if len(collisions)
            else self.reach
        )

    def forces(self, displacement: np.ndarray) -> np.ndarray:
        """Contact forces (N, 3) in N of the bodies on the N nodes of the pad."""
        positions, collisions = self._near(displacement)
        if not len(collisions):
            return np.zeros_like(displacement)
        gradient = self._potential.gradient(collisions, self._mesh, positions).reshape(-1, 3)
        return self._interpolation.T @ -gradient[: self._interpolation.shape[0]]

    def stiffness(self, displacement: np.ndarray, steady: bool = False) -> sparse.csr_array:
        """Contact stiffness (3 N, 3 N): the negative derivative of the forces with respect to the displacement.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement of the nodes, mm.
        steady : bool
            Whether negative eigenvalues of each pair are set to 0.

        Returns
        -------
        (3 N, 3 N) csr_array
            Stiffness in N/mm.
        """
        (positions, collisions), count = self._near(displacement), 3 * self._interpolation.shape[0]
        if not len(collisions):
            return sparse.csr_array((displacement.size, displacement.size))
        projection = self._ipc.PSDProjectionMethod.CLAMP if steady else self._ipc.PSDProjectionMethod.NONE
        hessian = sparse.coo_array(self._potential.hessian(collisions, self._mesh, positions, projection))
        of_pad = (hessian.row < count) & (hessian.col < count)
        degrees, number = np.unique(np.stack([hessian.row[of_pad], hessian.col[of_pad]]), return_inverse=True)
        point_stiffness = sparse.csr_array(
            (hessian.data[of_pad], tuple(number.reshape(2, -1))), shape=(len(degrees), len(degrees))
        )
        components = 3 * np.arange(len(degrees)) + degrees % 3
        interpolation = sparse.kron(self._interpolation[degrees // 3], np.eye(3), format="csr")[components]
        return sparse.csr_array(interpolation.T @ point_stiffness @ interpolation)

    def free_fraction(self, before: np.ndarray, after: np.ndarray) -> float:
        """Fraction of a step of the nodes' displacements in which the pad does not hit a body, with a margin.

        Parameters
        ----------
        before : (N, 3) ndarray
            Displacement at the start of the step, mm.
        after : (N, 3) ndarray
            Displacement at its end, mm.

        Returns
        -------
        float
            Fraction, at most 1.
        """
        start, end = self._places(before), self._places(after)
        pairs = self._pairs(np.minimum(start, end), np.maximum(start, end), 0.0)
        if not len(pairs):
            return 1.0
        fraction = float(pairs.compute_collision_free_stepsize(self._mesh, start, end, 0.0, self._ccd))
        return fraction if fraction >= 1 else APPROACH * fraction

    def _places(self, displacement: np.ndarray) -> np.ndarray:
        return np.asfortranarray(np.concatenate([self._interpolation @ (self._points + displacement), self._corners]))

    def _near(self, displacement: np.ndarray) -> tuple[np.ndarray, Any]:
        """Positions of pad and bodies, and the pairs of points, edges and triangles within the reach; the latest result
        is cached."""
        positions, last = self._places(displacement), self._last
        if not np.array_equal(positions, last[0]):
            collisions = self._ipc.NormalCollisions()
            collisions.use_area_weighting = True
            collisions.build(self._pairs(positions, positions, self.reach), self._mesh, positions, self.reach)
            last = self._last = positions, collisions
        return last

    def _pairs(self, low: np.ndarray, high: np.ndarray, margin: float) -> Any:
        """Candidates for contact: pairs of a point, edge or triangle of the pad and a point, edge or triangle of a body
        whose bounding boxes overlap.

        Boxes enclose the lowest and highest positions ``low`` and ``high`` (P, 3) of the P points, with a ``margin``;
        all in mm.
        """
        count = self._interpolation.shape[0]
        boxes = self._pad_facets.boxes(low[:count] - margin, high[:count] + margin)
        candidates, ipc = self._ipc.Candidates(), self._ipc
        candidates.fv_candidates = [
            *_overlapping(ipc.FaceVertexCandidate, boxes["triangles"], self._fixed["points"]),
            *_overlapping(
                lambda point, face: ipc.FaceVertexCandidate(face, point), boxes["points"], self._fixed["triangles"]
            ),
        ]
        candidates.ee_candidates = _overlapping(ipc.EdgeEdgeCandidate, boxes["sides"], self._fixed["sides"])
        return candidates


class _Facets:
    """Points, S sides (S, 2) and K triangles (K, 3) of the surface of the pad or of the bodies. The collision mesh
    holds both surfaces; the first number of each kind in it is stored too."""

    def __init__(self, triangles: np.ndarray, first_point: int, first_side: int, first_triangle: int) -> None:
        sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        self.triangles, self.sides = triangles, np.unique(sides, axis=0)
        self._first = {"points": first_point, "sides": first_side, "triangles": first_triangle}

    def boxes(self, low: np.ndarray, high: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray, int]]:
        """Bounding boxes of the points, sides and triangles. For each of these three keys: lowest corners (n, 3),
        highest corners (n, 3), and the number of the first item in the collision mesh.
        """
        boxes = {"points": (low, high, self._first["points"])}
        for kind, members in (("sides", self.sides), ("triangles", self.triangles)):
            lowest = np.minimum.reduce([low[column] for column in members.T])
            highest = np.maximum.reduce([high[column] for column in members.T])
            boxes[kind] = lowest, highest, self._first[kind]
        return boxes


class _Fixed(NamedTuple):
    """Bounding boxes of the points, sides or triangles of the bodies, which do not move: a search tree of boxes, and
    the number of the first item in the collision mesh."""

    tree: BoxTree
    levels: list[Level]
    first: int

    @classmethod
    def of(cls, low: np.ndarray, high: np.ndarray, first: int) -> _Fixed:
        tree = BoxTree(low + high)
        return cls(tree, tree.levels(low, high), first)


def _overlapping(
    pair: Callable[[int, int], Any], own_boxes: tuple[np.ndarray, np.ndarray, int], fixed: _Fixed
) -> list[Any]:
    """Results of ``pair(i, j)`` for each item i of the pad whose bounding box overlaps that of an item j of the
    bodies."""
    (low, high, first), ((lowest,), (highest,)) = own_boxes, fixed.levels[0]
    candidates = np.flatnonzero((low <= highest).all(axis=1) & (high >= lowest).all(axis=1))
    if not len(candidates):
        return []
    tree = BoxTree(low[candidates] + high[candidates])
    own_index, fixed_index = tree.overlapping_with(
        tree.levels(low[candidates], high[candidates]), fixed.tree, fixed.levels
    )
    return list(map(pair, (candidates[own_index] + first).tolist(), (fixed_index + fixed.first).tolist()))
