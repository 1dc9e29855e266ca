"""Forces that keep the walls of a pad apart, and off the board, from a barrier potential.

Faces are cut into four flat triangles. Between their points, edges and triangles the potential of incremental potential
contact acts below a small distance (M. Li et al., ACM Trans. Graph. 39, 2020), computed by `ipctk`; the same function
acts between points of the faces and the board. It grows without limit as a distance goes to zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.singular_edges import STRIP
from mitsuba_taxel.mechanics.contact.ipc_toolkit import ipctk_of_one_thread
from mitsuba_taxel.pads.regions import REGIONS

REACH = 2e-3
"""Largest distance at which walls repel each other, relative to the pad's height."""
REACH_AT_REST = 0.5
"""Upper limit of that distance, relative to the smallest distance between two triangles of the undeformed pad that
share no corner."""
APPROACH = 0.9
"""Fraction of the distance to a collision that a step may use."""
CLOSE = 0.99
"""Fraction of the way to a collision at which the search for collisions stops; larger than `APPROACH`."""

_QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
_FOURTHS = np.array([[4 - i - j, i, j] for i in range(5) for j in range(5 - i)]) / 4
_POINTS = shape_functions(_FOURTHS)
"""Values (15, 6) of the six shape functions of a face at its 15 points that are kept above the board."""


class Barrier:
    """Repulsion of the surface of a pad, except its glued bottom, from itself and from the board.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the whole undeformed pad, which stands on the board.
    modulus : float
        Modulus that scales the repulsion, in MPa: the pressure at a third of the reach is about twice the modulus.
    fraction : float
        Reach of the repulsion, relative to the default.

    Attributes
    ----------
    reach : float
        Largest distance at which surfaces repel each other, mm.

    Raises
    ------
    InputError
        without `ipctk`.
    """

    def __init__(self, mesh: VolumeMesh, modulus: float, fraction: float = 1.0) -> None:
        self._ipc = ipc = ipctk_of_one_thread()
        faces = mesh.faces[mesh.face_region != REGIONS["bottom"]]
        self._nodes, number = np.unique(faces, return_inverse=True)
        triangles = number.reshape(-1, 6)[:, _QUARTERS].reshape(-1, 3)
        sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        self._points = mesh.points
        self._mesh = ipc.CollisionMesh(
            *(np.asfortranarray(array) for array in (mesh.points[self._nodes], np.unique(sides, axis=0), triangles))
        )
        height = float(np.ptp(mesh.points[:, 2]))
        self._last: tuple[np.ndarray, Any] = np.empty(0), None
        self.reach = REACH / REACH_AT_REST * height  # for the search in gap()
        self.reach = fraction * REACH_AT_REST * self.gap(np.zeros_like(mesh.points))
        self._last = np.empty(0), None  # cached pairs of a barrier with another reach
        self._potential = ipc.BarrierPotential(self.reach, modulus, True)
        self._ccd = additive_ccd(ipc)

        self._board = float(mesh.points[:, 2].min())
        face, point = np.nonzero(mesh.points[faces, 2] @ _POINTS.T >= self._board + STRIP * height)
        entries = _POINTS[point].ravel(), (np.arange(len(face)).repeat(6), faces[face].ravel())
        self._over = sparse.csr_array(entries, shape=(len(face), len(mesh.points)))
        corner_a, corner_b, corner_c = np.moveaxis(mesh.points[faces[:, :3]], 1, 0)
        area = np.linalg.norm(np.cross(corner_b - corner_a, corner_c - corner_a), axis=1) / 2
        self._weight = modulus * area[face] / len(_POINTS)

    def gap(self, displacement: np.ndarray) -> float:
        """Smallest distance in mm between two triangles of the pad's surface that share no corner; at most the range of
        the repulsion.
        """
        positions, collisions = self._near(displacement)
        return (
            float(np.sqrt(collisions.compute_minimum_distance(self._mesh, positions)))
            if len(collisions)
            else self.reach
        )

    def forces(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Contact forces on the N nodes, two arrays (N, 3) in N: those between parts of the pad, and those of the board
        on nodes that are not glued to it."""
        own, board = np.zeros_like(displacement), np.zeros_like(displacement)
        positions, collisions = self._near(displacement)
        own[self._nodes] = -self._potential.gradient(collisions, self._mesh, positions).reshape(-1, 3)
        slope, _ = self._repulsion(displacement)
        if slope.any():
            board[:, 2] = self._over.T @ (-self._weight * slope)
        return own, board

    def stiffness(self, displacement: np.ndarray, steady: bool = False) -> sparse.csr_array:
        """Contact stiffness (3 N, 3 N) in N/mm: the negative derivative of the forces on N nodes with respect to their
        displacement.

        Forces that change their direction about a corner cause negative eigenvalues. With ``steady``, the negative
        eigenvalues of each pair of touching triangles, edges or points are set to 0.

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
        positions, collisions = self._near(displacement)
        projection = self._ipc.PSDProjectionMethod.CLAMP if steady else self._ipc.PSDProjectionMethod.NONE
        hessian = sparse.coo_array(self._potential.hessian(collisions, self._mesh, positions, projection))
        degrees = (3 * self._nodes[:, None] + np.arange(3)).ravel()
        point_stiffness = self._weight * self._repulsion(displacement)[1]
        if not (point_stiffness.any() or hessian.nnz):
            return sparse.csr_array((displacement.size, displacement.size))
        board = sparse.coo_array(self._over.T @ sparse.diags_array(point_stiffness) @ self._over)
        rows = np.concatenate([degrees[hessian.row], 3 * board.row + 2])
        columns = np.concatenate([degrees[hessian.col], 3 * board.col + 2])
        values = np.concatenate([hessian.data, board.data])
        return sparse.csr_array((values, (rows, columns)), shape=(displacement.size, displacement.size))

    def free_fraction(self, before: np.ndarray, after: np.ndarray) -> float:
        """Fraction of a step of the nodes' displacements that is free of collisions, with a margin.

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
        fraction = float(self._ipc.compute_collision_free_stepsize(self._mesh, start, end, narrow_phase_ccd=self._ccd))
        height_before, height_after = self._height(before), self._height(after)
        approaching = height_after <= (1 - APPROACH) * height_before
        to_board = float(
            (APPROACH * height_before[approaching] / (height_before - height_after)[approaching]).min(initial=1.0)
        )
        return min(fraction if fraction >= 1 else APPROACH * fraction, to_board)

    def _repulsion(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivatives, each (p,), of the barrier potential -(z / r - 1)^2 r log(z / r) with respect to
        the height z of each of p points above the board; r is the reach, beyond which they are 0."""
        z = np.minimum(self._height(displacement) / self.reach, 1.0)
        first = 2 * (1 - z) * np.log(z) - (1 - z) ** 2 / z
        second = -2 * np.log(z) + 4 * (1 - z) / z + (1 - z) ** 2 / z**2
        return first, second / self.reach

    def _height(self, displacement: np.ndarray) -> np.ndarray:
        """Height (p,) in mm of p points of the faces above the board."""
        return self._over @ (self._points + displacement)[:, 2] - self._board

    def _places(self, displacement: np.ndarray) -> np.ndarray:
        return np.asfortranarray((self._points + displacement)[self._nodes])

    def _near(self, displacement: np.ndarray) -> tuple[np.ndarray, Any]:
        """Positions of the surface, and the pairs of points, edges and triangles within the reach; the latest result is
        cached."""
        positions, last = self._places(displacement), self._last
        if not np.array_equal(positions, last[0]):
            collisions = self._ipc.NormalCollisions()
            collisions.use_area_weighting = True
            collisions.build(self._mesh, positions, self.reach)
            last = self._last = positions, collisions
        return last


def additive_ccd(ipctk: Any) -> Any:
    """Additive continuous collision detection, which advances as far as distances allow.

    It takes milliseconds, whereas the default of `ipctk`, by inclusion, takes half the time of a step (M. Li, D. M.
    Kaufman and C. Jiang, ACM Trans. Graph. 40, 2021).
    """
    return ipctk.AdditiveCCD(conservative_rescaling=CLOSE)
