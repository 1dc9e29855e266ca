"""The sum of all barriers of a pad: against its own walls, the board, and rigid bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.barrier import Barrier
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.barriers.body_barrier import BodyBarrier

LONGEST_STEP = 0.1
"""Largest movement of a node in a step that is searched for collisions, relative to the pad's height. Beyond, boxes
around moving faces overlap nearly all others, and a search takes hundreds of times as long."""
SHAPE_STEP = 1e-4
"""Largest movement of a node for a finite difference, relative to the reach of the pad's own barrier."""


class Contacts:
    """All barriers (repulsive forces at small distances) of a pad: against itself, the board and rigid bodies.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the whole undeformed pad.
    modulus : float
        Young's modulus, which scales the barriers, MPa.
    bodies : RigidBodies or None
        Bodies that the pad may touch; None for none.
    fraction : float
        Reach of the barriers, relative to the default.
    """

    def __init__(self, mesh: VolumeMesh, modulus: float, bodies: RigidBodies | None, fraction: float = 1.0) -> None:
        self._mesh, self._settings = mesh, (modulus, bodies, fraction)
        self._own = Barrier(mesh, modulus, fraction)
        self._bodies = None if bodies is None else BodyBarrier(mesh, modulus, bodies, fraction)
        self._longest_step = LONGEST_STEP * float(np.ptp(mesh.points[:, 2]))

    def forces(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Contact forces on the N nodes, two arrays (N, 3) in N: those between parts of the pad, and those of the board
        and the bodies."""
        own, external = self._own.forces(displacement)
        return own, external if self._bodies is None else external + self._bodies.forces(displacement)

    def all_forces(self, displacement: np.ndarray) -> np.ndarray:
        """Total contact force (N, 3) in N on each of the N nodes, from the pad itself, the board and the bodies."""
        own, external = self.forces(displacement)
        return own + external

    def stiffness(self, displacement: np.ndarray, steady: bool = False) -> sparse.csr_array:
        """Contact stiffness (3 N, 3 N) in N/mm: the negative derivative of the forces on N nodes with respect to their
        displacement; without negative eigenvalues of any pair if ``steady``.

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
        own = self._own.stiffness(displacement, steady)
        return own if self._bodies is None else own + self._bodies.stiffness(displacement, steady)

    def shape_rate(self, displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Derivative of the total contact forces with respect to a shape parameter, at constant displacements.

        It is a central difference, because areas and the reach change too.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement of the nodes, mm.
        velocity : (N, 3) ndarray
            Movement of the undeformed nodes in mm per unit of the parameter.

        Returns
        -------
        (N, 3) ndarray
            Derivative of the forces in N per unit of the parameter.
        """
        fastest = float(np.abs(velocity).max(initial=0.0))
        if fastest == 0:
            return np.zeros_like(displacement)
        step = SHAPE_STEP * self._own.reach / fastest
        meshes = (replace(self._mesh, points=self._mesh.points + shift * velocity) for shift in (step, -step))
        ahead, behind = (Contacts(mesh, *self._settings).all_forces(displacement) for mesh in meshes)
        return (ahead - behind) / (2 * step)

    def free_fraction(self, before: np.ndarray, after: np.ndarray) -> float:
        """Fraction of a step of the nodes' displacements that is free of collisions, with a margin, and moves no node
        further than `LONGEST_STEP`.

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
        longest = float(np.linalg.norm(after - before, axis=1).max())
        searched = 1.0 if longest <= self._longest_step else self._longest_step / longest
        if searched < 1:
            after = before + searched * (after - before)
        free = self._own.free_fraction(before, after)
        if self._bodies is not None:
            free = min(free, self._bodies.free_fraction(before, after))
        return searched * free
