"""Taylor-Hood finite elements for finite strain: element forces, volumes and matrices, computed in chunks.

Displacements are quadratic, the pressure linear on each tetrahedron (total Lagrangian, perturbed Lagrangian)::

    Pi(u, p) = int W_iso(F) + p (J - 1) - p^2 / (2 kappa) dV - f . u,    F = 1 + grad u,  J = det F

(G. A. Holzapfel, Nonlinear Solid Mechanics, 2000, section 8.3). The constitutive law provides the isochoric stress and
tangent only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.processes.threads import side_by_side
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_gradients
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.internal_variables import Softening, StressUpdate
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.moduli import PAIRS
from mitsuba_taxel.mechanics.materials.viscoelastic import components, tensors

Result = TypeVar("Result")

# The corners and the centres of the faces: exact to degree 3, which the forces of a homogeneous state need on curved
# elements. With points at the corners, a volume that shrinks to zero there costs infinite energy. With inner points
# only, elements would be inverted at corners on the glued rim, where the stress is singular; the smaller the elements,
# the smaller the load at which this happens.
_CORNERS = np.concatenate([np.zeros((1, 3)), np.eye(3)])
QUADRATURE_POINTS = np.concatenate([_CORNERS, (_CORNERS.sum(axis=0) - _CORNERS) / 3])
QUADRATURE_WEIGHTS = np.repeat([1 / 40, 9 / 40], 4) / 6
_PRESSURE_SHAPES = np.concatenate([1 - QUADRATURE_POINTS.sum(axis=1, keepdims=True), QUADRATURE_POINTS], axis=1)

ELEMENTS_AT_ONCE = 256
"""Elements that are evaluated together: their arrays fit the processor's cache."""
SMALL_STRAIN = 1e-6
"""Largest displacement gradient of a finite difference."""
_NEXT, _LAST = [1, 2, 0], [2, 0, 1]


@dataclass(frozen=True)
class Matrices:
    """Derivatives of the forces and volumes of all elements, as matrices; they are the arguments of
    :meth:`Sparsity.summed`.
    """

    blocks: np.ndarray
    mixed: np.ndarray
    pressures: np.ndarray


@dataclass(frozen=True)
class ElementState:
    """Internal forces (m, 10, 3) in N, volumes (m, 4) in mm³ and tangents of m elements, and the smallest volume
    ratio."""

    forces: np.ndarray
    volumes: np.ndarray
    matrices: Matrices | None
    min_jacobian: float


@dataclass(frozen=True)
class SmallStrain:
    """Small-strain response at those quadrature points (near sharp corners) where the material law is linear.

    Attributes
    ----------
    at : (m, q) ndarray of bool
        Whether the law is linear at each quadrature point of m elements.
    gradient : (n, 3, 3) ndarray
        Displacement gradient at these n points.
    """

    at: np.ndarray
    gradient: np.ndarray

    @property
    def growth(self) -> np.ndarray:
        """Relative change (n,) of volume in small strain: the trace of the displacement gradient."""
        return np.trace(self.gradient, axis1=1, axis2=2)

    def stress(self, shear_modulus: float) -> np.ndarray:
        """Isochoric stress (n, 3, 3) in MPa, 2 mu (e - tr(e) / 3) of the strain e, which is the stress of any law to
        first order."""
        both = self.gradient + np.swapaxes(self.gradient, 1, 2)
        return shear_modulus * (both - 2 / 3 * self.growth[:, None, None] * np.eye(3))


class Elements:
    """The m elements of a mesh of one material, with q quadrature points each.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    material : Material
        Elastic law.
    linear : (m, q) ndarray of bool, optional
        Whether the law at each quadrature point is that of small strain.

    Attributes
    ----------
    nodes : (m, 10) ndarray
        Nodes of each element, ascending.
    corners : (m, 4) ndarray
        Corners of each element.
    weight : (m, q) ndarray
        Volume of each quadrature point in mm³.
    gradients : (m, q, 10, 3) ndarray
        Gradients of the shape functions of ``nodes``, 1/mm.
    linear : (m, q) ndarray or None
        Whether the law at each quadrature point is that of small strain; None if it is at no point.

    Raises
    ------
    ComputationError
        if an element is flat.
    """

    def __init__(self, mesh: VolumeMesh, material: Material, linear: np.ndarray | None = None) -> None:
        self.material, self.linear = material, linear
        order = np.argsort(mesh.tets, axis=1)
        self.nodes, self.corners = np.take_along_axis(mesh.tets, order, axis=1), mesh.tets[:, :4]
        reference, count = shape_gradients(QUADRATURE_POINTS), len(order)
        self.weight = np.empty((count, len(reference)))
        # One array serves as gradients, and as matrices with one row for each node: it is the largest of a pad.
        self._by_node = np.empty((count, 10, 3 * len(reference)))
        self.gradients = np.swapaxes(self._by_node.reshape(count, 10, len(reference), 3), 1, 2)

        def fill(start: int) -> None:
            here = slice(start, start + ELEMENTS_AT_ONCE)
            x = mesh.points[mesh.tets[here]]
            along = np.moveaxis(np.tensordot(x, reference, (1, 1)), 1, -1)
            cofactor = cofactors(along)
            determinant = (along[..., 0, :] * cofactor[..., 0, :]).sum(axis=-1)
            if not determinant.all():
                raise ComputationError("a finite element of the pad at rest is flat: another mesh_size is needed.")
            self.weight[here] = determinant * QUADRATURE_WEIGHTS
            inverse = np.moveaxis(cofactor / determinant[..., None, None], 0, 2).reshape(len(reference), 3, -1)
            gradients = (reference @ inverse).reshape(len(reference), 10, len(x), 3)
            self.gradients[here] = np.take_along_axis(np.moveaxis(gradients, 2, 0), order[here, None, :, None], axis=2)

        in_turns(fill, count)

    def evaluate(
        self,
        displacement: np.ndarray,
        pressure: np.ndarray,
        with_matrices: bool,
        stress_update: StressUpdate | Softening | None = None,
    ) -> ElementState:
        """Forces, volumes and tangents of all elements at a state.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement of the nodes, mm.
        pressure : (corners,) ndarray
            Pressure at each corner of the elements in MPa, positive in tension.
        with_matrices : bool
            Whether tangents are needed.
        stress_update : StressUpdate or Softening, optional
            Isochoric stress of a viscoelastic solid, or of one with Mullins' effect, from that of the law.

        Returns
        -------
        ElementState
            Forces, volumes and tangents; without tangents if an element is inverted.
        """
        count = len(self.nodes)
        forces, volumes, least = np.empty((count, 10, 3)), np.empty((count, 4)), np.empty(count)
        matrices = None
        if with_matrices:
            pairs = len(PAIRS[0])
            matrices = Matrices(np.empty((count, pairs, 9)), np.empty((count, 4, 30)), np.empty((count, 4, 4)))

        def fill(start: int) -> None:
            # Kinematics at the quadrature points; an inverted element has no stress.
            here = slice(start, start + ELEMENTS_AT_ONCE)
            weight, p = self.weight[here], self.pressures(here, pressure)
            gradient, small = self.at_rest(here, self.gradient(here, displacement) + np.eye(3))
            cofactor = cofactors(gradient)
            determinant = (gradient[..., 0, :] * cofactor[..., 0, :]).sum(axis=-1)
            least[here] = determinant.min(axis=1)
            if not determinant.min() > 0:
                return

            # First Piola-Kirchhoff stress: isochoric, of the history, and of the pressure. Mullins' effect multiplies
            # that of the law by eta(W), which is 1 where the law is linear.
            state = gradient, determinant, cofactor / determinant[..., None, None]
            factor, overstress, damage = 1.0, None, None
            law_stress = stress = self.material.stress(*state)
            if isinstance(stress_update, StressUpdate):
                factor, overstress = stress_update.factor, tensors(stress_update.offset[here])
                stress = factor * stress + gradient @ overstress
            elif isinstance(stress_update, Softening):
                energies = self.material.energy(gradient), stress_update.largest[here]
                damage = stress_update.mullins.damage_variable(*energies)
                stress = damage[..., None, None] * stress
            stress = stress + p[..., None, None] * cofactor
            excess = determinant - 1 - self.material.compressibility * p
            if small is not None:
                stress[small.at] += factor * small.stress(self.material.shear_modulus)
                excess[small.at] += small.growth
            forces[here] = self.on_nodes(here, stress)
            volumes[here] = self.on_corners(here, excess)
            if matrices is None:
                return

            # Blocks of displacements. Where the law is linear, forces of pressure and history do not turn with the
            # solid. The derivative of F S with respect to F at constant S is that of a prestressed solid.
            follower_pressure = p
            if small is not None:
                follower_pressure = np.where(small.at, 0.0, p)
                overstress = None if overstress is None else np.where(small.at[..., None, None], 0.0, overstress)
            if damage is not None and isinstance(stress_update, Softening):
                # The derivative of eta P is eta dP/dF + d(eta)/dW P P, as P = dW/dF.
                moduli = self.material.moduli(*state, follower_pressure / damage)
                slope = 0.5 * stress_update.mullins.damage_slope(*energies) / damage
                moduli.pairs.append((law_stress, slope[..., None, None] * law_stress))
                blocks = moduli.stiffness(damage * weight, self.gradients[here])
            elif overstress is None:
                blocks = self.material.moduli(*state, follower_pressure).stiffness(weight, self.gradients[here])
            else:
                moduli = self.material.moduli(*state, follower_pressure / factor).with_inner(overstress / factor)
                blocks = factor * moduli.stiffness(weight, self.gradients[here])
            matrices.blocks[here] = blocks

            # Blocks of pressures with displacements, and of pressures.
            normal = _columns(weight, cofactor).reshape(len(p), -1, 3, 1, 3) * _PRESSURE_SHAPES[:, None, :, None]
            mixed = (self._by_node[here] @ normal.reshape(len(p), -1, 12)).reshape(len(p), 10, 4, 3)
            matrices.mixed[here] = np.swapaxes(mixed, 1, 2).reshape(len(p), 4, 30)
            mass = (weight[:, None, :] * _PRESSURE_SHAPES.T) @ _PRESSURE_SHAPES
            matrices.pressures[here] = -self.material.compressibility * mass

        in_turns(fill, count)
        lowest = float(least.min())
        return ElementState(forces, volumes, matrices if lowest > 0 else None, lowest)

    def at_rest(self, here: slice, gradient: np.ndarray) -> tuple[np.ndarray, SmallStrain | None]:
        """Deformation gradient F (m, q, 3, 3) of a slice of elements, and their small strain; None if the law is linear
        nowhere. Where it is linear, F is replaced by the identity.
        """
        if self.linear is None or not self.linear[here].any():
            return gradient, None
        at = self.linear[here]
        return np.where(at[..., None, None], np.eye(3), gradient), SmallStrain(at, gradient[at] - np.eye(3))

    def isochoric_stress(self, displacement: np.ndarray) -> np.ndarray:
        """Second Piola-Kirchhoff stress (m, q, 6) in MPa of the material at a displacement (N, 3). Where the law is
        linear, it is the stress of small strain."""

        def stress(start: int) -> np.ndarray:
            here = slice(start, start + ELEMENTS_AT_ONCE)
            gradient, small = self.at_rest(here, self.gradient(here, displacement) + np.eye(3))
            cofactor = cofactors(gradient)
            determinant = (gradient[..., 0, :] * cofactor[..., 0, :]).sum(axis=-1)
            inverse_transpose = cofactor / determinant[..., None, None]
            first = self.material.stress(gradient, determinant, inverse_transpose)
            if small is not None:
                first[small.at] += small.stress(self.material.shear_modulus)
            return components(np.swapaxes(inverse_transpose, -1, -2) @ first)

        return np.concatenate(in_turns(stress, len(self.nodes)))

    def isochoric_energy(self, displacement: np.ndarray) -> np.ndarray:
        """Isochoric energy density (m, q) in MPa of the material at a displacement (N, 3). Where the law is linear, it
        is 0."""

        def energy(start: int) -> np.ndarray:
            here = slice(start, start + ELEMENTS_AT_ONCE)
            return self.material.energy(self.at_rest(here, self.gradient(here, displacement) + np.eye(3))[0])

        return np.concatenate(in_turns(energy, len(self.nodes)))

    def isochoric_rate(self, displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Rate (m, q, 6) in MPa/s of the isochoric stress with a ``velocity`` (N, 3) in mm/s, by a central
        difference."""
        fastest = float(np.abs(self.gradient(slice(None), velocity)).max())
        if not fastest > 0:
            return np.zeros((*self.weight.shape, 6))
        move = SMALL_STRAIN / fastest * velocity
        change = self.isochoric_stress(displacement + move) - self.isochoric_stress(displacement - move)
        return fastest / (2 * SMALL_STRAIN) * change

    def pulled(self, displacement: np.ndarray, stress: np.ndarray) -> np.ndarray:
        """Nodal forces (m, 10, 3) in N of elements with second Piola-Kirchhoff stresses (m, q, 6) in MPa, at a
        displacement (N, 3).
        """
        every = slice(None)
        gradient = self.at_rest(every, self.gradient(every, displacement) + np.eye(3))[0]
        return self.on_nodes(every, gradient @ tensors(stress))

    def on_nodes(self, here: slice, stress: np.ndarray) -> np.ndarray:
        """Nodal forces (m, 10, 3) in N of a slice of elements with first Piola-Kirchhoff stresses (m, q, 3, 3) in MPa.
        """
        return self._by_node[here] @ _columns(self.weight[here], stress)

    def on_corners(self, here: slice, excess: np.ndarray) -> np.ndarray:
        """Volumes (m, 4) in mm³ at the corners of m elements: relative volumes (m, q) at the quadrature points,
        multiplied by the shape functions of the corners and integrated.
        """
        return (self.weight[here] * excess) @ _PRESSURE_SHAPES

    def pressures(self, here: slice, pressure: np.ndarray) -> np.ndarray:
        """Pressure (m, q) in MPa at the quadrature points of a slice of m elements, from the pressure (C,) at all C
        corners."""
        return pressure[self.corners[here]] @ _PRESSURE_SHAPES.T

    def gradient(self, here: slice | np.ndarray, field: np.ndarray) -> np.ndarray:
        """Gradient (m, q, 3, 3) of a field (N, 3) at the quadrature points of selected elements."""
        gradient = np.swapaxes(field[self.nodes[here]], 1, 2) @ self._by_node[here]
        return np.swapaxes(gradient.reshape(len(gradient), 3, -1, 3), 1, 2)


def quadrature_places(mesh: VolumeMesh) -> np.ndarray:
    """Quadrature points (m, q, 3) in mm of the undeformed elements."""
    return shape_functions(_PRESSURE_SHAPES) @ mesh.points[mesh.tets]


def in_turns(work: Callable[[int], Result], count: int) -> list[Result]:
    """Call ``work(first)`` for one chunk of :data:`ELEMENTS_AT_ONCE` elements after the other, and return all results.
    ``first`` is the number of the first element of a chunk.
    """
    return side_by_side(work, range(0, count, ELEMENTS_AT_ONCE))


def _columns(weight: np.ndarray, tensors: np.ndarray) -> np.ndarray:
    """Multiply tensors (m, q, 3, 3) by weights (m, q), transpose them, and stack those of each element: matrices (m, 3
    q, 3).
    """
    return np.swapaxes(weight[..., None, None] * tensors, -1, -2).reshape(len(weight), -1, 3)


def cofactors(matrices: np.ndarray) -> np.ndarray:
    """Cofactors of matrices (..., 3, 3): J F^-T."""
    down, up = matrices[..., _NEXT, :], matrices[..., _LAST, :]
    return down[..., _NEXT] * up[..., _LAST] - down[..., _LAST] * up[..., _NEXT]
