"""Taylor-Hood finite elements for finite strain: element forces, volumes and matrices, computed in chunks.

Displacements are quadratic, the pressure linear on each tetrahedron (total Lagrangian, perturbed Lagrangian)::

    Pi(u, p) = int W_iso(F) + p (J - 1) - p^2 / (2 kappa) dV - f . u,    F = 1 + grad u,  J = det F

(G. A. Holzapfel, Nonlinear Solid Mechanics, 2000, section 8.3). The constitutive law provides the isochoric stress and
tangent only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.processes.threads import side_by_side
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_gradients
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.moduli import PAIRS
from mitsuba_taxel.mechanics.materials.viscoelastic import components, tensors

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.elements.internal_variables import StressUpdate

Result = TypeVar("Result")

# The corners and the middles of the faces: exact to degree 3, as the forces of a homogeneous state need on curved
# elements. A volume that shrinks to nothing at a corner costs infinite energy. With points inside only it does not:
# elements are then inverted at corners on the glued rim, where the stress is singular: smaller ones earlier.
_CORNERS = np.concatenate([np.zeros((1, 3)), np.eye(3)])
QUADRATURE_POINTS = np.concatenate([_CORNERS, (_CORNERS.sum(axis=0) - _CORNERS) / 3])
QUADRATURE_WEIGHTS = np.repeat([1 / 40, 9 / 40], 4) / 6
_PRESSURE_SHAPES = np.concatenate([1 - QUADRATURE_POINTS.sum(axis=1, keepdims=True), QUADRATURE_POINTS], axis=1)

ELEMENTS_AT_ONCE = 256
"""Chosen to fit the processor's cache."""
SMALL_STRAIN = 1e-6
"""Largest displacement gradient of a difference quotient."""
_NEXT, _LAST = [1, 2, 0], [2, 0, 1]
Points = tuple[np.ndarray, np.ndarray, np.ndarray]
"""F, det F and F^-T at points."""


@dataclass(frozen=True)
class Matrices:
    """Element tangents, in the form that :meth:`Sparsity.summed` takes."""

    blocks: np.ndarray
    mixed: np.ndarray
    pressures: np.ndarray


@dataclass(frozen=True)
class ElementState:
    """Internal forces (m, 10, 3), volumes (m, 4) and tangents of m elements at a state; smallest volume ratio."""

    forces: np.ndarray
    volumes: np.ndarray
    matrices: Matrices | None
    min_jacobian: float


@dataclass(frozen=True)
class SmallStrain:
    """Points ``at`` (m, q) of some elements where the law is linear, and the gradient (n, 3, 3) of displacement."""

    at: np.ndarray
    gradient: np.ndarray

    @property
    def growth(self) -> np.ndarray:
        """(n,) relative change of volume."""
        return np.trace(self.gradient, axis1=1, axis2=2)

    def stress(self, shear_modulus: float) -> np.ndarray:
        """(n, 3, 3) MPa, isochoric stress 2 mu (e - tr(e) / 3) of the strain e: that of any law to first order."""
        both = self.gradient + np.swapaxes(self.gradient, 1, 2)
        return shear_modulus * (both - 2 / 3 * self.growth[:, None, None] * np.eye(3))


class Elements:
    """The elements of a mesh, of one material.

    Attributes
    ----------
    nodes : (m, 10) ascending; corners : (m, 4)
    weight : (m, q) ndarray
        Volume of each quadrature point in mm³.
    gradients : (m, q, 10, 3) ndarray
        Of the shape functions of ``nodes``, 1/mm.
    linear : (m, q) ndarray or None
        Whether the law at a quadrature point is that of small strain; None if nowhere.

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
        self.gradients = np.empty((count, *reference.shape))

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
        self._by_node = np.swapaxes(self.gradients, 1, 2).reshape(count, 10, -1)

    def evaluate(
        self,
        displacement: np.ndarray,
        pressure: np.ndarray,
        with_matrices: bool,
        stress_update: StressUpdate | None = None,
    ) -> ElementState:
        """Elements at displacement (N, 3) and pressure (corners,); without matrices if one is inverted.

        The stress includes that of the ``stress_update``.
        """
        count = len(self.nodes)
        forces, volumes, least = np.empty((count, 10, 3)), np.empty((count, 4)), np.empty(count)
        matrices = (
            Matrices(np.empty((count, len(PAIRS[0]), 9)), np.empty((count, 4, 30)), np.empty((count, 4, 4)))
            if with_matrices
            else None
        )

        def fill(start: int) -> None:
            here = slice(start, start + ELEMENTS_AT_ONCE)
            weight, p = self.weight[here], self.pressures(here, pressure)
            by_node = self._by_node[here]
            gradient, small = self.at_rest(here, self.gradient(here, displacement) + np.eye(3))
            cofactor = cofactors(gradient)
            determinant = (gradient[..., 0, :] * cofactor[..., 0, :]).sum(axis=-1)
            least[here] = determinant.min(axis=1)
            if not determinant.min() > 0:
                return
            state = gradient, determinant, cofactor / determinant[..., None, None]
            stress, kept = self.material.stress(*state), None
            if stress_update is not None:
                kept = tensors(stress_update.offset[here])
                stress = stress_update.factor * stress + gradient @ kept
            stress = stress + p[..., None, None] * cofactor
            excess = determinant - 1 - self.material.compressibility * p
            if small is not None:
                share = 1.0 if stress_update is None else stress_update.factor
                stress[small.at] += share * small.stress(self.material.shear_modulus)
                excess[small.at] += small.growth
            forces[here] = self.on_nodes(here, stress)
            volumes[here] = self.on_corners(here, excess)
            if matrices is None:
                return
            turning = p
            if small is not None:  # whose forces do not turn with the solid
                turning = np.where(small.at, 0.0, p)
                kept = None if kept is None else np.where(small.at[..., None, None], 0.0, kept)
            matrices.blocks[here] = self._stiffness(here, state, turning, stress_update, kept)
            normal = _columns(weight, cofactor).reshape(len(p), -1, 3, 1, 3) * _PRESSURE_SHAPES[:, None, :, None]
            mixed = (by_node @ normal.reshape(len(p), -1, 12)).reshape(len(p), 10, 4, 3)
            matrices.mixed[here] = np.swapaxes(mixed, 1, 2).reshape(len(p), 4, 30)
            mass = (weight[:, None, :] * _PRESSURE_SHAPES.T) @ _PRESSURE_SHAPES
            matrices.pressures[here] = -self.material.compressibility * mass

        in_turns(fill, count)
        lowest = float(least.min())
        return ElementState(forces, volumes, matrices if lowest > 0 else None, lowest)

    def at_rest(self, here: slice, gradient: np.ndarray) -> tuple[np.ndarray, SmallStrain | None]:
        """F (m, q, 3, 3) of some elements, that of rest where the law is linear, and what it leaves out there."""
        if self.linear is None or not self.linear[here].any():
            return gradient, None
        at = self.linear[here]
        return np.where(at[..., None, None], np.eye(3), gradient), SmallStrain(at, gradient[at] - np.eye(3))

    def _stiffness(
        self,
        here: slice,
        state: Points,
        pressure: np.ndarray,
        stress_update: StressUpdate | None,
        kept: np.ndarray | None,
    ) -> np.ndarray:
        """Blocks of some elements: the derivative of F S by F at constant S is that of a prestressed solid."""
        weight, gradients = self.weight[here], self.gradients[here]
        if stress_update is None or kept is None:
            return self.material.moduli(*state, pressure).stiffness(weight, gradients)
        moduli = self.material.moduli(*state, pressure / stress_update.factor).with_inner(kept / stress_update.factor)
        return stress_update.factor * moduli.stiffness(weight, gradients)

    def isochoric_stress(self, displacement: np.ndarray) -> np.ndarray:
        """(m, q, 6) MPa, second Piola-Kirchhoff stress of the material at a displacement (N, 3); where the law is
        linear, that of small strain."""

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

    def isochoric_rate(self, displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """(m, q, 6) MPa/s, rate of that stress with a ``velocity`` (N, 3) in mm/s, by a central difference."""
        fastest = float(np.abs(self.gradient(slice(None), velocity)).max())
        if not fastest > 0:
            return np.zeros((*self.weight.shape, 6))
        move = SMALL_STRAIN / fastest * velocity
        change = self.isochoric_stress(displacement + move) - self.isochoric_stress(displacement - move)
        return fastest / (2 * SMALL_STRAIN) * change

    def pulled(self, displacement: np.ndarray, stress: np.ndarray) -> np.ndarray:
        """(m, 10, 3) forces of second Piola-Kirchhoff stresses (m, q, 6) at a displacement (N, 3)."""
        every = slice(None)
        gradient = self.at_rest(every, self.gradient(every, displacement) + np.eye(3))[0]
        return self.on_nodes(every, gradient @ tensors(stress))

    def on_nodes(self, here: slice, stress: np.ndarray) -> np.ndarray:
        """(m, 10, 3) forces of stresses (m, q, 3, 3) at the quadrature points of some elements."""
        return self._by_node[here] @ _columns(self.weight[here], stress)

    def on_corners(self, here: slice, excess: np.ndarray) -> np.ndarray:
        """(m, 4) volumes from relative ones (m, q)."""
        return (self.weight[here] * excess) @ _PRESSURE_SHAPES

    def pressures(self, here: slice, pressure: np.ndarray) -> np.ndarray:
        """(m, q) pressure at the quadrature points of some elements, from that at the corners (C,)."""
        return pressure[self.corners[here]] @ _PRESSURE_SHAPES.T

    def gradient(self, here: slice | np.ndarray, field: np.ndarray) -> np.ndarray:
        """(m, q, 3, 3) gradient of a field (N, 3) at the quadrature points of some elements."""
        gradient = np.swapaxes(field[self.nodes[here]], 1, 2) @ self._by_node[here]
        return np.swapaxes(gradient.reshape(len(gradient), 3, -1, 3), 1, 2)


def quadrature_places(mesh: VolumeMesh) -> np.ndarray:
    """(m, q, 3) mm, quadrature points of the undeformed elements."""
    return shape_functions(_PRESSURE_SHAPES) @ mesh.points[mesh.tets]


def in_turns(work: Callable[[int], Result], count: int) -> list[Result]:
    """Results of ``work`` for each chunk of :data:`ELEMENTS_AT_ONCE` of ``count`` elements, given its first."""
    return side_by_side(work, range(0, count, ELEMENTS_AT_ONCE))


def _columns(weight: np.ndarray, tensors: np.ndarray) -> np.ndarray:
    """(m, 3 q, 3) transposes of tensors (m, q, 3, 3), times weights (m, q), stacked."""
    return np.swapaxes(weight[..., None, None] * tensors, -1, -2).reshape(len(weight), -1, 3)


def cofactors(matrices: np.ndarray) -> np.ndarray:
    """Cofactors of matrices (..., 3, 3): J F^-T."""
    down, up = matrices[..., _NEXT, :], matrices[..., _LAST, :]
    return down[..., _NEXT] * up[..., _LAST] - down[..., _LAST] * up[..., _NEXT]
