"""All that a pad is kept off: its own walls, the board, and rigid bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.barrier import Barrier
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.barriers.body_barrier import BodyBarrier

SHAPE_STEP = 1e-4
"""Largest movement of a node for a difference, relative to the reach of the pad's own barrier."""


class Contacts:
    """The sum of the barriers of a pad; parameters are those of a `BodyBarrier`, whose bodies may be None."""

    def __init__(self, mesh: VolumeMesh, modulus: float, bodies: RigidBodies | None, share: float = 1.0) -> None:
        self._mesh, self._others = mesh, (modulus, bodies, share)
        self._own = Barrier(mesh, modulus, share)
        self._bodies = None if bodies is None else BodyBarrier(mesh, modulus, bodies, share)

    def forces(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) nodal forces in N of the pad on itself, and of board and bodies on it."""
        own, other = self._own.forces(displacement)
        return own, other if self._bodies is None else other + self._bodies.forces(displacement)

    def all_forces(self, displacement: np.ndarray) -> np.ndarray:
        """(N, 3) N, their sum."""
        own, other = self.forces(displacement)
        return own + other

    def stiffness(self, displacement: np.ndarray, steady: bool = False) -> sparse.csr_array:
        """(3 N, 3 N) derivative of the forces by the displacement, with the opposite sign; without negative eigenvalues
        of any pair if ``steady``."""
        own = self._own.stiffness(displacement, steady)
        return own if self._bodies is None else own + self._bodies.stiffness(displacement, steady)

    def shape_rate(self, displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """(N, 3) rate of all forces at a constant displacement while the undeformed nodes move by a velocity (N, 3).

        By a central difference, as areas and the reach change too.
        """
        fastest = float(np.abs(velocity).max(initial=0.0))
        if fastest == 0:
            return np.zeros_like(displacement)
        step = SHAPE_STEP * self._own.reach / fastest
        meshes = (replace(self._mesh, points=self._mesh.points + way * velocity) for way in (step, -step))
        ahead, behind = (Contacts(mesh, *self._others).all_forces(displacement) for mesh in meshes)
        return (ahead - behind) / (2 * step)

    def free_share(self, before: np.ndarray, after: np.ndarray) -> float:
        """Share, at most 1, of the way from one displacement (N, 3) to another that meets nothing, with a margin."""
        own = self._own.free_share(before, after)
        return own if self._bodies is None else min(own, self._bodies.free_share(before, after))
