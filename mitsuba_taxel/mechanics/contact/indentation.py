"""Contact of a rigid indenter with the faces of a mesh.

The pressure has a value at each node and is linear between them, on each face divided into four triangles. It prevents
penetration on average: the gap, weighted by the linear function of the node, is not negative (M. A. Puso, T. A. Laursen
and J. Solberg, Comput. Methods Appl. Mech. Eng. 197, 2008: mortar contact of quadratic elements). The remaining
penetration is the pressure over a penalty stiffness, so that both follow from the displacement. The contact energy is E
= sum 1/2 min(gap, 0)^2 / slack, where slack is the penalty compliance of a node; forces are its negative derivative.
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
"""Penalty stiffness: the contact pressure, relative to Young's modulus, at a penetration as large as the face."""
SHAPE_STEP = 1e-5
"""Largest displacement of a node, relative to the pad's height, for finite differences with respect to the shape."""

_NODES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])
_PIECES = np.array([[0, 3, 5], [1, 4, 3], [2, 5, 4], [3, 4, 5]])
# Three points on each of the four triangles, exact to degree 2 there.
_HATS = np.concatenate([(np.full((3, 3), 1 / 6) + np.eye(3) / 2) @ np.eye(len(_NODES))[piece] for piece in _PIECES])
"""Values (q, 6) of the linear functions of a face's six nodes at its q quadrature points."""
_WEIGHTS = np.full(len(_HATS), 0.5 / len(_HATS))
_VALUES, _SLOPES = shape_functions(_HATS @ _NODES), shape_slopes(_HATS @ _NODES)
_PRODUCTS = (_HATS[:, :, None] * _VALUES[:, None, :]).reshape(len(_HATS), -1)
"""Products (q, 36) of each linear function and each quadratic shape function at these points."""


class ContactState(NamedTuple):
    """Gaps and forces between an indenter and the m nodes of the faces that it may touch, in a mesh of N nodes.

    Attributes
    ----------
    gaps : Gap
        Distances at the quadrature points of all faces.
    gap : (m,) ndarray
        Distance times the linear function of each node, integrated over the undeformed faces, mm³.
    rate : (m, 3 N) csr_array
        Derivative of the gap with respect to the displacement of each node, mm².
    area_normal : (m, 3) ndarray
        Normals integrated in the same way, mm²: the negative derivative of the gap with respect to the displacement of
        the indenter.
    pressure : (m,) ndarray
        Pressure at each node, MPa.
    friction_forces : (N, 3) ndarray or float
        Nodal forces of friction, N.
    """

    gaps: Gap
    gap: np.ndarray
    rate: sparse.csr_array
    area_normal: np.ndarray
    pressure: np.ndarray
    friction_forces: np.ndarray | float = 0.0

    @property
    def force(self) -> np.ndarray:
        """Total force (3,) in N of the indenter on the faces."""
        return self.nodal_forces.sum(axis=0)

    @property
    def nodal_forces(self) -> np.ndarray:
        """Forces (N, 3) in N of the indenter on the nodes."""
        return (self.rate.T @ self.pressure).reshape(-1, 3) + self.friction_forces


class Indentation:
    """A rigid indenter, and the faces of a mesh that it may touch: the faces of the top and of the outside.

    The unknown contact pressures belong to nodes: m pressures in all. A node where top and outside meet has one
    pressure on each.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    indenter : Indenter
        The rigid body.
    modulus : float
        Young's modulus of the silicone, MPa.

    Attributes
    ----------
    node : (m,) ndarray
        Number of the node to which each pressure belongs.
    points : (m, 3) ndarray
        Undeformed position of this node in mm.
    numbers : (B, 6) ndarray
        Numbers of the pressures at the nodes of each of B faces.
    outside : (m,) ndarray
        1 for a pressure on the outside, 0 on the top.
    area : (m,) ndarray
        Integral of the linear shape function of each pressure over the faces, mm².
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
        self.points = mesh.points[self.node]
        self.outside = (keys // len(mesh.points) == REGIONS["outer"]).astype(int)
        self._areas = _WEIGHTS * np.linalg.norm(np.cross(*(s @ mesh.points[self.faces] for s in _SLOPES)), axis=2)
        self._weights = self._areas[:, :, None] * _HATS
        size = np.sqrt(2 * self._areas.sum(axis=1))
        self.area = self._over_nodes(self._weights.sum(axis=1))
        self.slack = self._over_nodes(self._weights.sum(axis=1) * size[:, None]) / (STIFFNESS * modulus)

    @cached_property
    def carried(self) -> sparse.csr_array:
        """Matrix (m, N) in mm² for the conversion of a field at N nodes to its contributions to m nodal pressures. Its
        product with the values of the field is the integral of the field times the linear shape function of each
        pressure."""
        weights = np.einsum("bqh,qa->bha", self._weights, _VALUES)
        columns = np.broadcast_to(self.faces[:, None, :], weights.shape)
        rows = np.broadcast_to(self.numbers[:, :, None], weights.shape)
        shape = len(self.node), len(self._mesh.points)
        return sparse.coo_array((weights.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsr()

    @cached_property
    def _pattern(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sparsity pattern (CSR) of :attr:`ContactState.rate`. Returns the position in the array of entries to which
        each product of two shape functions of a face is added, for each axis; the columns of the entries; and the start
        of each row."""
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
        """Distribute values (m, 3) at the m contact pressures to an array (2 N, 3) for all N nodes: first for nodes of
        the top, then for nodes of the outside. Nodes without a contact pressure get 0.
        """
        at_nodes = np.zeros((2, len(self._mesh.points), 3))
        at_nodes[self.outside, self.node] = values
        return at_nodes.reshape(-1, 3)

    def at_nodes(self, nodal: np.ndarray) -> np.ndarray:
        """Select the values (m, 3) at nodes with a contact pressure from an array that :meth:`nodal` has made; zeros if
        the array is empty.
        """
        if not len(nodal):
            return np.zeros((len(self.node), 3))
        return nodal.reshape(2, -1, 3)[self.outside, self.node]

    def _over_nodes(self, of_faces: np.ndarray) -> np.ndarray:
        """Assemble values of faces at contact nodes: for each of the m pressures, the sum (m,) of the values (B, 6)
        that B faces have at its node."""
        return np.bincount(self.numbers.ravel(), of_faces.ravel(), len(self.node))

    def contact_state(
        self,
        displacement: np.ndarray,
        moved: np.ndarray,
        pressure: np.ndarray | None = None,
        traction: np.ndarray | None = None,
    ) -> ContactState:
        """Gaps, pressures and forces between the displaced indenter and the deformed faces.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement of the nodes, mm.
        moved : (3,) ndarray
            Displacement of the indenter from its start, mm.
        pressure : (m,) ndarray, optional
            Pressures in MPa; by default they follow from the gaps by the penalty.
        traction : (m, 3) ndarray, optional
            Tractions of friction in MPa; none by default.

        Returns
        -------
        ContactState
            Gaps, pressures and forces.
        """
        start = self.indenter.body.start(self._mesh.points[self._highest])
        points = _VALUES @ (self._mesh.points - start + (displacement - moved))[self.faces]
        gaps = self.indenter.body.gap(points.reshape(-1, 3))
        gap = self._over_nodes((self._areas * gaps.size.reshape(self._areas.shape)) @ _HATS)
        normal = self._areas[:, :, None] * gaps.normal.reshape(points.shape)
        lift = _HATS.T @ normal
        target, columns, starts = self._pattern
        slopes = np.bincount(target, (_PRODUCTS.T @ normal).ravel(), len(columns))
        shape = len(self.node), 3 * len(self._mesh.points)
        rate = sparse.csr_array((slopes, columns, starts), shape=shape)
        lift = np.stack([self._over_nodes(lift[:, :, axis]) for axis in range(3)], axis=1)
        if pressure is None:
            pressure = np.maximum(-gap, 0.0) / self.slack
        return ContactState(gaps, gap, rate, lift, pressure, 0.0 if traction is None else self.carried.T @ traction)

    def rate(self, contact: ContactState, direction: np.ndarray, active: np.ndarray) -> np.ndarray:
        """Derivative (N, 3) in N/mm of the nodal forces with respect to a movement of the indenter along ``direction``
        (3,); the pressures with the numbers ``active`` follow the gaps, all others are constant."""
        pressure_rate = contact.area_normal[active] @ direction / self.slack[active]
        nodal = (contact.rate[active].T @ pressure_rate).reshape(-1, 3)
        np.add.at(nodal, self.faces, np.einsum("bqi,qa->bai", -self._turning(contact) @ direction, _VALUES))
        return nodal

    def force_rate(self, contact: ContactState, direction: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Derivative (3,) in N/mm of the total force with respect to a movement of the indenter along ``direction``
        (3,), while the nodes are displaced at the ``rate`` (N, 3) in mm per mm."""
        pressure_rate = (contact.area_normal @ direction - contact.rate @ rate.ravel()) / self.slack
        turning_force = np.einsum("bqij,bqj->i", self._turning(contact), _VALUES @ rate[self.faces] - direction)
        return np.where(contact.pressure > 0, pressure_rate, 0.0) @ contact.area_normal + turning_force

    def force_gradient(self, contact: ContactState) -> np.ndarray:
        """Derivative (N, 3) of the total force along z with respect to the displacement of each node, N/mm."""
        pressure_rate = np.where(contact.pressure > 0, contact.area_normal[:, 2] / self.slack, 0.0)
        nodal = -(contact.rate.T @ pressure_rate).reshape(-1, 3)
        np.add.at(nodal, self.faces, np.einsum("bqj,qa->baj", self._turning(contact)[:, :, 2], _VALUES))
        return nodal

    def shape_rate(self, displacement: np.ndarray, moved: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Derivative of the nodal forces with respect to a shape parameter, which moves the undeformed nodes, and the
        indenter with the highest node.

        It is a central difference in which the same nodes stay in contact.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement of the nodes, mm.
        moved : (3,) ndarray
            Displacement of the indenter from its start, mm.
        velocity : (N, 3) ndarray
            Movement of the undeformed nodes in mm per unit of the parameter.

        Returns
        -------
        (N, 3) ndarray
            Derivative of the forces in N per unit of the parameter.
        """
        active = self.contact_state(displacement, moved).pressure > 0
        step = SHAPE_STEP * np.ptp(self._mesh.points[:, 2]) / max(float(np.abs(velocity).max()), np.finfo(float).tiny)

        def nodal_forces(step_taken: float) -> np.ndarray:
            shifted = Indentation(
                replace(self._mesh, points=self._mesh.points + step_taken * velocity), self.indenter, self._modulus
            )
            shifted._highest = self._highest
            contact = shifted.contact_state(displacement, moved)
            return contact._replace(pressure=np.where(active, -contact.gap / shifted.slack, 0.0)).nodal_forces

        return (nodal_forces(step) - nodal_forces(-step)) / (2 * step)

    def stiffness(self, contact: ContactState) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (n, 6) of the n faces in contact, and the stiffness (n, 18, 18) in N/mm of each at constant pressures.

        It is not zero, because the directions of the pressures follow the normals of the indenter.
        """
        active = (contact.pressure[self.numbers] > 0).any(axis=1)
        turning = self._turning(contact)[active]
        matrices = np.einsum("bqij,qa,qc->baicj", -turning, _VALUES, _VALUES, optimize=True)
        return self.faces[active], matrices.reshape(-1, 18, 18)

    def _turning(self, contact: ContactState) -> np.ndarray:
        """Derivative (B, q, 3, 3), in N/mm, of the contact force at each of q quadrature points of B faces with respect
        to the position of the point. It includes only the change of the force's direction, which follows the normal of
        the indenter.
        """
        force = np.einsum("bqh,bh->bq", self._weights, contact.pressure[self.numbers])
        return force[:, :, None, None] * contact.gaps.curvature.reshape(*force.shape, 3, 3)
