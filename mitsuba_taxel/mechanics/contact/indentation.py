"""Forces of a rigid body on the faces that it presses on, and how they change.

At quadrature points of the undeformed faces the body pushes back what is inside of it, by a stiffness per area:
E = int c/2 min(g, 0)^2 dA with g the distance from the body (P. Wriggers, Computational Contact Mechanics, 2006,
sections 5.1 and 6.3). Forces and stiffness are its derivatives, so that matrices stay symmetric and of their pattern:
all nodes of a face lie in one element.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_slopes
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.indenter import Gap, Indenter
from mitsuba_taxel.pads.pad import REGIONS

STIFFNESS = 300.0
"""Pressure by which a body is kept out of a face where it is in by the size of the face, in Young's moduli."""
SHAPE_STEP = 1e-5
"""Fastest node's way, relative to the pad's height, that differences of areas are taken with."""

# Twelve points, exact to degree 6 (D. A. Dunavant, Int. J. Numer. Methods Eng. 21, 1985).
_A, _B, _C, _D = 0.249286745170910, 0.063089014491502, 0.310352451033785, 0.053145049844816
_PLACES = [(a, b, 1 - a - b) for a in (_A, _B) for a, b in ((a, a), (a, 1 - 2 * a), (1 - 2 * a, a))]
_PLACES += [
    (x, y, 1 - x - y)
    for x, y in (
        (_C, _D),
        (_D, _C),
        (_C, 1 - _C - _D),
        (1 - _C - _D, _C),
        (_D, 1 - _C - _D),
        (1 - _C - _D, _D),
    )
]
BARYCENTRIC = np.array(_PLACES)
WEIGHTS = np.array([0.116786275726379] * 3 + [0.050844906370207] * 3 + [0.082851075618374] * 6) / 2
_VALUES, _SLOPES = shape_functions(BARYCENTRIC), shape_slopes(BARYCENTRIC)


class Pressing(NamedTuple):
    """What presses at quadrature points: their ``face`` and ``point`` (n,), the ``force`` (n,) of each in N along the
    gap's normal, and its ``stiffness`` (n,) in N/mm."""

    face: np.ndarray
    point: np.ndarray
    gap: Gap
    force: np.ndarray
    stiffness: np.ndarray


class Indentation:
    """A rigid body and the faces of a mesh that it may press on: top and outside.

    Parameters
    ----------
    modulus : float
        MPa.
    """

    def __init__(self, mesh: VolumeMesh, indenter: Indenter, modulus: float) -> None:
        self.indenter, self._points, self._modulus = indenter, mesh.points, modulus
        self.faces = mesh.faces[np.isin(mesh.face_region, (REGIONS["top"], REGIONS["outer"]))]
        self._highest = int(mesh.points[:, 2].argmax())
        self._start = np.array([*indenter.at, mesh.points[self._highest, 2]])
        self.area = self._areas(mesh.points)
        self._stiffness = self._per_depth(self.area)

    def _areas(self, points: np.ndarray) -> np.ndarray:
        """(B, q) mm² that each quadrature point stands for."""
        return WEIGHTS * np.linalg.norm(np.cross(*(slopes @ points[self.faces] for slopes in _SLOPES)), axis=2)

    def _per_depth(self, area: np.ndarray) -> np.ndarray:
        """(B, q) N/mm of each quadrature point."""
        return STIFFNESS * self._modulus * area / np.sqrt(2 * area.sum(axis=1, keepdims=True))

    def pressing(self, displacement: np.ndarray, moved: np.ndarray) -> Pressing:
        """What presses under a displacement (N, 3) of the nodes, with the body moved by (3,), in mm."""
        places = _VALUES @ (self._points + displacement)[self.faces] - (self._start + moved)
        gap = self.indenter.gap(places.reshape(-1, 3))
        force = -gap.size * self._stiffness.ravel()
        inside = np.flatnonzero(force > 0)
        face, point = np.divmod(inside, len(WEIGHTS))
        return Pressing(face, point, Gap(*(part[inside] for part in gap)), force[inside], self._stiffness[face, point])

    def forces(self, at: Pressing, vectors: np.ndarray) -> np.ndarray:
        """(N, 3) nodal forces of forces (n, 3) at the points that press."""
        nodal = np.zeros_like(self._points)
        np.add.at(nodal, self.faces[at.face], _VALUES[at.point][:, :, None] * vectors[:, None])
        return nodal

    def pushed(self, at: Pressing) -> np.ndarray:
        """(N, 3) nodal forces."""
        return self.forces(at, at.force[:, None] * at.gap.normal)

    def rate(self, at: Pressing, direction: np.ndarray) -> np.ndarray:
        """(N, 3) by how much nodal forces grow while the body moves along ``direction`` (3,)."""
        return self.forces(at, _blocks(at) @ direction)

    def force_rate(self, at: Pressing, direction: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """(3,) by how much the total force grows while the body moves along ``direction`` (3,), nodes by ``rate``."""
        moves = direction - np.einsum("na,nai->ni", _VALUES[at.point], rate[self.faces[at.face]])
        return np.einsum("nij,nj->i", _blocks(at), moves)

    def shape_rate(self, at: Pressing, mesh: VolumeMesh, velocity: np.ndarray) -> np.ndarray:
        """(N, 3) by how much nodal forces grow as the undeformed nodes move by ``velocity`` (N, 3), and the body with
        the highest of them."""
        moves = np.einsum("na,nai->ni", _VALUES[at.point], velocity[self.faces[at.face]])
        moves[:, 2] -= velocity[self._highest, 2]
        forces = -np.einsum("nij,nj->ni", _blocks(at), moves)
        step = SHAPE_STEP * np.ptp(mesh.points[:, 2]) / max(float(np.abs(velocity).max()), np.finfo(float).tiny)
        ahead, behind = (self._per_depth(self._areas(mesh.points + k * velocity)) for k in (step, -step))
        stiffer = (ahead - behind)[at.face, at.point] / (2 * step) / at.stiffness
        return self.forces(at, forces + (stiffer * at.force)[:, None] * at.gap.normal)

    def stiffness(self, at: Pressing) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (m, 6) of the faces that are pressed on, and what they put up against displacements, (m, 18, 18)."""
        pressed, place = np.unique(at.face, return_inverse=True)
        values = _VALUES[at.point]
        matrices = np.zeros((len(pressed), 6, 3, 6, 3))
        np.add.at(matrices, place, np.einsum("na,nij,nb->naibj", values, _blocks(at), values, optimize=True))
        return self.faces[pressed], matrices.reshape(-1, 18, 18)


def _blocks(at: Pressing) -> np.ndarray:
    """(n, 3, 3) by how much the force of each point changes with its place."""
    normal = at.gap.normal
    along = at.stiffness[:, None, None] * normal[:, :, None] * normal[:, None, :]
    return along - at.force[:, None, None] * at.gap.curvature
