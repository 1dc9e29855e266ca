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
    ipctk_of_one_thread,
)
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.cutting import cut_faces
from mitsuba_taxel.pads.regions import REGIONS

CUTS = 6
"""Triangles along the longest edge of a face: as many as light meets by default."""


class BodyBarrier:
    """The repulsion of the surface of a pad, except its glued bottom, from rigid bodies.

    Faces are cut as for the light, into so small triangles that curved faces are within the reach of them. Pairs of
    points, edges and triangles of the pad are left to the pad's own barrier.

    Parameters
    ----------
    mesh : VolumeMesh
        Of the whole undeformed pad, which touches no body.
    modulus : float
        MPa, as of the pad's own barrier.
    bodies : RigidBodies
    share : float
        Of the usual reach.

    Attributes
    ----------
    reach : float
        In mm, distance from which on bodies repel the pad.

    Raises
    ------
    InputError
        without `ipctk`.
    """

    def __init__(self, mesh: VolumeMesh, modulus: float, bodies: RigidBodies, share: float = 1.0) -> None:
        self._ipc = ipc = ipctk_of_one_thread()
        cut = cut_faces(mesh, CUTS)
        kept = cut.triangles[mesh.face_region[cut.faces] != REGIONS["bottom"]]
        used, number = np.unique(kept, return_inverse=True)
        point = cut.of_vertex[used]
        entries = cut.weights[point].ravel(), (np.arange(len(used)).repeat(6), cut.nodes[point].ravel())
        self._over = sparse.csr_array(entries, shape=(len(used), len(mesh.points)))
        self._points = mesh.points
        self._corners, of_bodies = bodies.surface

        self._own = _Parts(number.reshape(-1, 3), 0, 0, 0)
        counts = len(used), len(self._own.sides), len(self._own.triangles)
        others = _Parts(of_bodies, *counts)
        self._fixed = {kind: _Fixed.of(*boxes) for kind, boxes in others.boxes(self._corners, self._corners).items()}
        places = self._places(np.zeros_like(mesh.points))
        sides, triangles = (
            np.concatenate([getattr(self._own, part), len(used) + getattr(others, part)])
            for part in ("sides", "triangles")
        )
        self._mesh = ipc.CollisionMesh(places, np.asfortranarray(sides), np.asfortranarray(triangles))
        self._last: tuple[np.ndarray, Any] = np.empty(0), None
        self.reach = REACH / REACH_AT_REST * float(np.ptp(mesh.points[:, 2]))  # how far is looked
        self.reach = share * REACH_AT_REST * self.gap(np.zeros_like(mesh.points))
        self._last = np.empty(0), None  # that was within another reach
        self._potential = ipc.BarrierPotential(self.reach, modulus, True)
        self._ccd = additive_ccd(ipc)

    def gap(self, displacement: np.ndarray) -> float:
        """Smallest distance in mm of the pad from a body, if below the reach, which else it is."""
        places, near = self._near(displacement)
        return float(np.sqrt(near.compute_minimum_distance(self._mesh, places))) if len(near) else self.reach

    def forces(self, displacement: np.ndarray) -> np.ndarray:
        """(N, 3) nodal forces in N of the bodies on the pad."""
        places, near = self._near(displacement)
        if not len(near):
            return np.zeros_like(displacement)
        gradient = self._potential.gradient(near, self._mesh, places).reshape(-1, 3)
        return self._over.T @ -gradient[: self._over.shape[0]]

    def stiffness(self, displacement: np.ndarray, steady: bool = False) -> sparse.csr_array:
        """(3 N, 3 N) derivative of the forces by the displacement, with the opposite sign; as of the pad's own
        barrier."""
        (places, near), count = self._near(displacement), 3 * self._over.shape[0]
        if not len(near):
            return sparse.csr_array((displacement.size, displacement.size))
        projection = self._ipc.PSDProjectionMethod.CLAMP if steady else self._ipc.PSDProjectionMethod.NONE
        found = sparse.coo_array(self._potential.hessian(near, self._mesh, places, projection))
        own = (found.row < count) & (found.col < count)
        used, number = np.unique(np.stack([found.row[own], found.col[own]]), return_inverse=True)
        of_points = sparse.csr_array((found.data[own], tuple(number.reshape(2, -1))), shape=(len(used), len(used)))
        components = 3 * np.arange(len(used)) + used % 3
        over = sparse.kron(self._over[used // 3], np.eye(3), format="csr")[components]
        return sparse.csr_array(over.T @ of_points @ over)

    def free_share(self, before: np.ndarray, after: np.ndarray) -> float:
        """Share, at most 1, of the way from one displacement (N, 3) to another that meets nothing, with a margin."""
        start, end = self._places(before), self._places(after)
        pairs = self._pairs(np.minimum(start, end), np.maximum(start, end), 0.0)
        if not len(pairs):
            return 1.0
        share = float(pairs.compute_collision_free_stepsize(self._mesh, start, end, 0.0, self._ccd))
        return share if share >= 1 else APPROACH * share

    def _places(self, displacement: np.ndarray) -> np.ndarray:
        return np.asfortranarray(np.concatenate([self._over @ (self._points + displacement), self._corners]))

    def _near(self, displacement: np.ndarray) -> tuple[np.ndarray, Any]:
        """Places of pad and bodies, and the pairs of points, edges and triangles within the reach; kept of the last."""
        places, last = self._places(displacement), self._last
        if not np.array_equal(places, last[0]):
            near = self._ipc.NormalCollisions()
            near.use_area_weighting = True
            near.build(self._pairs(places, places, self.reach), self._mesh, places, self.reach)
            last = self._last = places, near
        return last

    def _pairs(self, low: np.ndarray, high: np.ndarray, margin: float) -> Any:
        """Pairs of a part of the pad and one of a body whose boxes overlap, for points within ``low`` and ``high``."""
        count = self._over.shape[0]
        own = self._own.boxes(low[:count] - margin, high[:count] + margin)
        found, ipc = self._ipc.Candidates(), self._ipc
        found.fv_candidates = [
            *_listed(ipc.FaceVertexCandidate, own["triangles"], self._fixed["points"]),
            *_listed(lambda point, face: ipc.FaceVertexCandidate(face, point), own["points"], self._fixed["triangles"]),
        ]
        found.ee_candidates = _listed(ipc.EdgeEdgeCandidate, own["sides"], self._fixed["sides"])
        return found


class _Parts:
    """Triangles (K, 3), their sides (S, 2) and points of a part of the collision mesh, with the first number of each
    kind."""

    def __init__(self, triangles: np.ndarray, first_point: int, first_side: int, first_triangle: int) -> None:
        sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        self.triangles, self.sides = triangles, np.unique(sides, axis=0)
        self._first = {"points": first_point, "sides": first_side, "triangles": first_triangle}

    def boxes(self, low: np.ndarray, high: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray, int]]:
        """Corners (n, 3) of the boxes of all points, sides and triangles, and their first numbers."""
        found = {"points": (low, high, self._first["points"])}
        for kind, members in (("sides", self.sides), ("triangles", self.triangles)):
            lowest = np.minimum.reduce([low[column] for column in members.T])
            highest = np.maximum.reduce([high[column] for column in members.T])
            found[kind] = lowest, highest, self._first[kind]
        return found


class _Fixed(NamedTuple):
    """Boxes that stay where they are, by their tree, and the first number."""

    tree: BoxTree
    levels: list[Level]
    first: int

    @classmethod
    def of(cls, low: np.ndarray, high: np.ndarray, first: int) -> _Fixed:
        tree = BoxTree(low + high)
        return cls(tree, tree.levels(low, high), first)


def _listed(pair: Callable[[int, int], Any], own: tuple[np.ndarray, np.ndarray, int], others: _Fixed) -> list[Any]:
    """The pairs of boxes that overlap."""
    (low, high, first), ((lowest,), (highest,)) = own, others.levels[0]
    near = np.flatnonzero((low <= highest).all(axis=1) & (high >= lowest).all(axis=1))
    if not len(near):
        return []
    tree = BoxTree(low[near] + high[near])
    one, other = tree.overlapping_with(tree.levels(low[near], high[near]), others.tree, others.levels)
    return list(map(pair, (near[one] + first).tolist(), (other + others.first).tolist()))
