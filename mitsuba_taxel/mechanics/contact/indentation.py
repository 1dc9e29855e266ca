"""Contact pressures of a rigid indenter.

The pressure has a value at each node and is linear between them, on each face divided into four triangles. It prevents
penetration on average: the gap, weighted by the linear function of the node, is not negative (M. A. Puso, T. A. Laursen
and J. Solberg, Comput. Methods Appl. Mech. Eng. 197, 2008: mortar contact of quadratic elements). The remaining
penetration is the pressure over a penalty stiffness, so that both follow from the displacement: E = sum 1/2 min(gap,
0)^2 / slack, and forces are its derivative.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_slopes
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.contact.indenter_shape import Gap
from mitsuba_taxel.pads.regions import REGIONS

STIFFNESS = 2e3
"""Pressure at a penetration of the size of the face, in Young's moduli."""
SHAPE_STEP = 1e-5
"""Largest displacement of a node, relative to the pad's height, for finite differences by the shape."""

_NODES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])
_PIECES = np.array([[0, 3, 5], [1, 4, 3], [2, 5, 4], [3, 4, 5]])
# Three points on each of the four triangles, exact to degree 2 there.
_HATS = np.concatenate([(np.full((3, 3), 1 / 6) + np.eye(3) / 2) @ np.eye(len(_NODES))[piece] for piece in _PIECES])
"""(q, 6) linear functions of the nodes at the quadrature points of a face."""
_WEIGHTS = np.full(len(_HATS), 0.5 / len(_HATS))
_VALUES, _SLOPES = shape_functions(_HATS @ _NODES), shape_slopes(_HATS @ _NODES)
_PRODUCTS = (_HATS[:, :, None] * _VALUES[:, None, :]).reshape(len(_HATS), -1)
"""(q, 36) of each linear function and each shape function."""


class Pressing(NamedTuple):
    """State of contact of an indenter with the nodes of faces.

    Attributes
    ----------
    at : Gap
        At the quadrature points of all faces.
    gap : (m,) ndarray
        Distance times the node's linear function, integrated over undeformed faces, mm³.
    rate : (m, 3 N) csr_array
        Derivative of the gap by the displacement of each node, mm².
    lift : (m, 3) ndarray
        Its negative derivative by the displacement of the indenter: normals, integrated in the same way, mm².
    pressure : (m,) ndarray
        At each node, MPa.
    dragged : (N, 3) ndarray or float
        Nodal forces of friction, N.
    """

    at: Gap
    gap: np.ndarray
    rate: sparse.csr_array
    lift: np.ndarray
    pressure: np.ndarray
    dragged: np.ndarray | float = 0.0

    @property
    def force(self) -> np.ndarray:
        """(3,) N, force of the indenter on the faces."""
        return self.pushed.sum(axis=0)

    @property
    def pushed(self) -> np.ndarray:
        """(N, 3) nodal forces in N."""
        return (self.rate.T @ self.pressure).reshape(-1, 3) + self.dragged


class Indentation:
    """A rigid indenter and the faces of a mesh that it may touch: top and outside.

    A node where the two meet has a pressure on each.

    Parameters
    ----------
    modulus : float
        MPa.

    Attributes
    ----------
    node : (m,) ndarray
        Node of each pressure.
    places : (m, 3) ndarray
        Its undeformed position in mm.
    numbers : (B, 6) ndarray
        Numbers of the pressures at the nodes of each face.
    outside : (m,) ndarray
        1 for a pressure on the outside, 0 on the top.
    area : (m,) ndarray
        Integral of its linear function, mm².
    slack : (m,) ndarray
        Penalty compliance: integrated penetration per pressure, mm³/MPa.
    """

    def __init__(self, mesh: VolumeMesh, indenter: Indenter, modulus: float) -> None:
        self.indenter, self._mesh, self._modulus = indenter, mesh, modulus
        touched = np.isin(mesh.face_region, (REGIONS["top"], REGIONS["outer"]))
        self.faces = mesh.faces[touched]
        self._highest = indenter.body.highest(mesh.points)
        keys = mesh.face_region[touched][:, None] * len(mesh.points) + self.faces
        keys, numbers = np.unique(keys, return_inverse=True)
        self.node, self.numbers = keys % len(mesh.points), numbers.reshape(-1, 6)
        self.places = mesh.points[self.node]
        self.outside = (keys // len(mesh.points) == REGIONS["outer"]).astype(int)
        self._areas = _WEIGHTS * np.linalg.norm(np.cross(*(s @ mesh.points[self.faces] for s in _SLOPES)), axis=2)
        self._weights = self._areas[:, :, None] * _HATS
        size = np.sqrt(2 * self._areas.sum(axis=1))
        self.area = self._over_nodes(self._weights.sum(axis=1))
        self.slack = self._over_nodes(self._weights.sum(axis=1) * size[:, None]) / (STIFFNESS * modulus)

    @cached_property
    def carried(self) -> sparse.csr_array:
        """(m, N) mm², weights of nodal values in integrals with the linear function of a pressure."""
        shares = np.einsum("bqh,qa->bha", self._weights, _VALUES)
        columns = np.broadcast_to(self.faces[:, None, :], shares.shape)
        rows = np.broadcast_to(self.numbers[:, :, None], shares.shape)
        shape = len(self.node), len(self._mesh.points)
        return sparse.coo_array((shares.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsr()

    @cached_property
    def _pattern(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of :attr:`Pressing.rate`: where each product of two functions of a face, along each axis, is summed; columns
        and starts of the rows."""
        count = len(self._mesh.points)
        keys, target = np.unique(self.numbers[:, :, None] * count + self.faces[:, None, :], return_inverse=True)
        starts = 3 * np.searchsorted(keys, count * np.arange(len(self.node) + 1))
        columns = 3 * (keys % count)[:, None] + np.arange(3)
        return (
            (3 * target.reshape(-1, 1) + np.arange(3)).ravel(),
            columns.ravel().astype(np.int32),
            starts.astype(np.int32),
        )

    def nodal(self, values: np.ndarray) -> np.ndarray:
        """(2 N, 3) values (m, 3), at nodes of the top, then of the outside."""
        found = np.zeros((2, len(self._mesh.points), 3))
        found[self.outside, self.node] = values
        return found.reshape(-1, 3)

    def at_nodes(self, nodal: np.ndarray) -> np.ndarray:
        """(m, 3) values from those of :meth:`nodal`; zeros where there are none."""
        if not len(nodal):
            return np.zeros((len(self.node), 3))
        return nodal.reshape(2, -1, 3)[self.outside, self.node]

    def _over_nodes(self, of_faces: np.ndarray) -> np.ndarray:
        """(m,) sums of values (B, 6) of faces at their nodes."""
        return np.bincount(self.numbers.ravel(), of_faces.ravel(), len(self.node))

    def pressing(
        self,
        displacement: np.ndarray,
        moved: np.ndarray,
        pressure: np.ndarray | None = None,
        traction: np.ndarray | None = None,
    ) -> Pressing:
        """State of contact of the indenter, ``moved`` by (3,) mm, with nodes at a displacement (N, 3).

        The ``pressure`` (m,) is that of the gaps by default; ``traction`` (m, 3) in MPa is that of friction.
        """
        start = self.indenter.body.start(self._mesh.points[self._highest])
        places = _VALUES @ (self._mesh.points - start + (displacement - moved))[self.faces]
        at = self.indenter.body.gap(places.reshape(-1, 3))
        gap = self._over_nodes((self._areas * at.size.reshape(self._areas.shape)) @ _HATS)
        normal = self._areas[:, :, None] * at.normal.reshape(places.shape)
        lift = _HATS.T @ normal
        target, columns, starts = self._pattern
        slopes = np.bincount(target, (_PRODUCTS.T @ normal).ravel(), len(columns))
        shape = len(self.node), 3 * len(self._mesh.points)
        rate = sparse.csr_array((slopes, columns, starts), shape=shape)
        lift = np.stack([self._over_nodes(lift[:, :, axis]) for axis in range(3)], axis=1)
        if pressure is None:
            pressure = np.maximum(-gap, 0.0) / self.slack
        return Pressing(at, gap, rate, lift, pressure, 0.0 if traction is None else self.carried.T @ traction)

    def rate(self, here: Pressing, direction: np.ndarray, pressed: np.ndarray) -> np.ndarray:
        """(N, 3) rate of nodal forces as the indenter moves along ``direction`` (3,), for the pressures with the
        numbers ``pressed``."""
        growth = here.lift[pressed] @ direction / self.slack[pressed]
        nodal = (here.rate[pressed].T @ growth).reshape(-1, 3)
        np.add.at(nodal, self.faces, np.einsum("bqi,qa->bai", -self._turning(here) @ direction, _VALUES))
        return nodal

    def force_rate(self, here: Pressing, direction: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """(3,) rate of the total force as the indenter moves along ``direction`` (3,) and the nodes by ``rate``."""
        growth = (here.lift @ direction - here.rate @ rate.ravel()) / self.slack
        turned = np.einsum("bqij,bqj->i", self._turning(here), _VALUES @ rate[self.faces] - direction)
        return np.where(here.pressure > 0, growth, 0.0) @ here.lift + turned

    def force_gradient(self, here: Pressing) -> np.ndarray:
        """(N, 3) derivative of the total force along z by the displacement of each node, N/mm."""
        growth = np.where(here.pressure > 0, here.lift[:, 2] / self.slack, 0.0)
        nodal = -(here.rate.T @ growth).reshape(-1, 3)
        np.add.at(nodal, self.faces, np.einsum("bqj,qa->baj", self._turning(here)[:, :, 2], _VALUES))
        return nodal

    def shape_rate(self, displacement: np.ndarray, moved: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """(N, 3) rate of nodal forces as the undeformed nodes move with ``velocity`` (N, 3), and the indenter with the
        highest of them."""
        pressed = self.pressing(displacement, moved).pressure > 0
        step = SHAPE_STEP * np.ptp(self._mesh.points[:, 2]) / max(float(np.abs(velocity).max()), np.finfo(float).tiny)

        def pushed(change: float) -> np.ndarray:
            other = Indentation(
                replace(self._mesh, points=self._mesh.points + change * velocity), self.indenter, self._modulus
            )
            other._highest = self._highest
            there = other.pressing(displacement, moved)
            return there._replace(pressure=np.where(pressed, -there.gap / other.slack, 0.0)).pushed

        return (pushed(step) - pushed(-step)) / (2 * step)

    def stiffness(self, here: Pressing) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (n, 6) of the faces in contact, and their stiffness (n, 18, 18) at constant pressures, whose directions
        follow the indenter's normals."""
        pressed = (here.pressure[self.numbers] > 0).any(axis=1)
        turning = self._turning(here)[pressed]
        matrices = np.einsum("bqij,qa,qc->baicj", -turning, _VALUES, _VALUES, optimize=True)
        return self.faces[pressed], matrices.reshape(-1, 18, 18)

    def _turning(self, here: Pressing) -> np.ndarray:
        """(B, q, 3, 3) N/mm, derivative of the force at each point by its position, due to the rotation of the
        normal."""
        force = np.einsum("bqh,bh->bq", self._weights, here.pressure[self.numbers])
        return force[:, :, None, None] * here.at.curvature.reshape(*force.shape, 3, 3)
