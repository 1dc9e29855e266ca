"""Taylor-Hood finite elements for finite strain: residual and tangent, vectorised over elements.

Displacements are quadratic, the pressure linear on each tetrahedron (total Lagrangian, perturbed Lagrangian)::

    Pi(u, p) = int W_iso(F) + p (J - 1) - p^2 / (2 kappa) dV - f . u,    F = 1 + grad u,  J = det F

(G. A. Holzapfel, Nonlinear Solid Mechanics, 2000, section 8.3). The constitutive law is asked for its isochoric
stress and tangent only.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.constraints import Numbering
from mitsuba_taxel.mechanics.materials import Material
from mitsuba_taxel.pads.quality import shape_gradients
from mitsuba_taxel.pads.volume_mesh import VolumeMesh

# Eight points (F. D. Witherden and P. E. Vincent, Comput. Math. Appl. 69, 2015), exact to degree 3 as the forces of a
# homogeneous state need on curved elements: four points, exact to degree 2, fail the patch test there.
_NEAR_FACES, _NEAR_CORNERS = 0.3281633025163817, 0.1080472498984286
QUADRATURE_POINTS = np.concatenate(
    [a + (1 - 4 * a) * np.concatenate([np.zeros((1, 3)), np.eye(3)]) for a in (_NEAR_FACES, _NEAR_CORNERS)]
)
QUADRATURE_WEIGHTS = np.repeat([0.1362178425370874, 0.1137821574629126], 4) / 6


ELEMENTS_AT_ONCE = 256


@dataclass(frozen=True)
class Inside:
    """What a body puts up at a state: forces and volumes over the unknowns, tangent, and its least volume ratio."""

    residual: np.ndarray
    tangent: sparse.csc_matrix | None
    min_jacobian: float


class Assembly:
    """Residual and tangent of a mesh and a material over the unknowns of a numbering."""

    def __init__(self, mesh: VolumeMesh, material: Material, numbering: Numbering) -> None:
        self.mesh, self.material, self.numbering = mesh, material, numbering
        reference = shape_gradients(QUADRATURE_POINTS)
        x = mesh.points[mesh.tets]
        jacobian = np.einsum("qai,maj->mqji", reference, x)
        self.weight = np.linalg.det(jacobian) * QUADRATURE_WEIGHTS
        self.gradients = np.einsum("qai,mqij->mqaj", reference, np.linalg.inv(jacobian))
        self.pressure_shapes = np.concatenate(
            [1 - QUADRATURE_POINTS.sum(axis=1, keepdims=True), QUADRATURE_POINTS], axis=1
        )
        self.unknowns = numbering.displacements + numbering.pressures
        displacement = (3 * mesh.tets[:, :, None] + np.arange(3)).reshape(len(mesh.tets), 30)
        dofs = np.concatenate([displacement, 3 * len(mesh.points) + mesh.tets[:, :4]], axis=1)
        self._element_unknowns, self._element_signs = numbering.unknown[dofs], numbering.sign[dofs]

    @cached_property
    def pattern(self) -> Pattern:
        """Where the tangent has entries."""
        return Pattern(self._element_unknowns, self._element_signs, self.unknowns)

    def evaluate(self, displacement: np.ndarray, pressure: np.ndarray, with_tangent: bool = True) -> Inside:
        """Internal forces and tangent at a state; the residual is that of no load.

        Parameters
        ----------
        displacement : (N, 3) mm
        pressure : (corners,) MPa, positive in tension
        """
        gradient = np.einsum("mai,mqaj->mqij", displacement[self.mesh.tets], self.gradients) + np.eye(3)
        determinant = np.linalg.det(gradient)
        least = float(determinant.min())
        if not least > 0:
            return Inside(np.full(self.unknowns, np.nan), None, least)
        inverse_transpose = np.swapaxes(np.linalg.inv(gradient), -1, -2)
        p = pressure[self.mesh.tets[:, :4]] @ self.pressure_shapes.T
        cofactor = determinant[..., None, None] * inverse_transpose
        stress = self.material.stress(gradient, determinant, inverse_transpose) + p[..., None, None] * cofactor
        residual = self._residual(stress, determinant, p)
        tangent = self._tangent(gradient, determinant, inverse_transpose, p) if with_tangent else None
        return Inside(residual, tangent, least)

    def _residual(self, stress: np.ndarray, determinant: np.ndarray, p: np.ndarray) -> np.ndarray:
        forces = np.einsum("mq,mqij,mqaj->mai", self.weight, stress, self.gradients, optimize=True)
        volume = self.weight * (determinant - 1 - self.material.compressibility * p)
        constraint = volume @ self.pressure_shapes
        element = np.concatenate([forces.reshape(len(forces), 30), constraint], axis=1)
        free = self._element_unknowns >= 0
        weights = (self._element_signs * element)[free]
        return np.bincount(self._element_unknowns[free], weights=weights, minlength=self.unknowns)

    def _tangent(
        self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray, p: np.ndarray
    ) -> sparse.csc_matrix:
        """Lower triangle of the tangent, from a few elements at a time, as many as the processor's cache holds."""
        matrix = np.empty((len(p), 34, 34))

        def fill(start: int) -> None:
            here = slice(start, start + ELEMENTS_AT_ONCE)
            state = (gradient[here], determinant[here], inverse_transpose[here])
            moduli = self.material.tangent(*state)
            moduli += _pressure_moduli(p[here] * determinant[here], inverse_transpose[here])
            cofactor = determinant[here, :, None, None] * inverse_transpose[here]
            self._fill(matrix[here], self.weight[here], self.gradients[here], moduli, cofactor)

        with ThreadPoolExecutor(os.cpu_count()) as pool:  # numpy works outside Python's lock
            list(pool.map(fill, range(0, len(p), ELEMENTS_AT_ONCE)))
        return self.pattern.matrix(self.pattern.summed(matrix))

    def _fill(
        self, matrix: np.ndarray, weight: np.ndarray, b: np.ndarray, moduli: np.ndarray, cofactor: np.ndarray
    ) -> None:
        """Matrices (m, 34, 34) of m elements, of which only the lower triangle is used."""
        count, points = weight.shape
        # sum over q, j, l of w B_aj A_ijkl B_bl, as two batched matrix products
        right = moduli.reshape(count, points, 27, 3) @ np.swapaxes(b, -1, -2)
        right = right.reshape(count, points, 3, 3, 3, 10).transpose(0, 1, 3, 2, 5, 4)  # (m, q, j, i, b, k)
        weighted = weight[..., None, None] * b
        left = weighted.transpose(0, 2, 1, 3).reshape(count, 10, 3 * points)
        stiffness = left @ np.ascontiguousarray(right).reshape(count, 3 * points, 90)  # (m, a, i b k)
        matrix[:, :30, :30] = stiffness.reshape(count, 30, 30)
        matrix[:, :30, 30:] = 0
        normal = (weighted @ np.swapaxes(cofactor, -1, -2)).reshape(count, points, 30)
        matrix[:, 30:, :30] = self.pressure_shapes.T @ normal
        mass = (weight[:, None, :] * self.pressure_shapes.T) @ self.pressure_shapes
        matrix[:, 30:, 30:] = -self.material.compressibility * mass


class Pattern:
    """Where the entries of elements' symmetric matrices go in the lower triangle of the sparse one."""

    def __init__(self, unknowns: np.ndarray, signs: np.ndarray, size: int) -> None:
        rows, columns = np.tril_indices(unknowns.shape[1])
        first, second = unknowns[:, rows].ravel(), unknowns[:, columns].ravel()
        self._entries = rows * unknowns.shape[1] + columns
        self._kept = np.flatnonzero((first >= 0) & (second >= 0))
        first, second = first[self._kept], second[self._kept]
        key = np.minimum(first, second).astype(np.int64) * size + np.maximum(first, second)
        self.keys, target = np.unique(key, return_inverse=True)
        self._target = target.astype(np.int32)
        self._indices = (self.keys % size).astype(np.int32)
        count = np.bincount(self.keys // size, minlength=size)
        self._indptr = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
        self._size = size
        # Two degrees of freedom of one element that follow the same unknown meet on the diagonal, twice.
        factor = np.where((first == second) & np.tile(rows != columns, len(unknowns))[self._kept], 2.0, 1.0)
        factor *= (signs[:, rows] * signs[:, columns]).ravel()[self._kept]
        self._factor = None if np.all(factor == 1) else factor

    def summed(self, matrices: np.ndarray) -> np.ndarray:
        """Entries of the sum of elements' matrices (m, n, n), of which the lower triangle is used."""
        entries = matrices.reshape(len(matrices), -1)[:, self._entries].ravel()[self._kept]
        if self._factor is not None:
            entries *= self._factor
        return np.bincount(self._target, weights=entries, minlength=len(self._indices))

    def matrix(self, entries: np.ndarray) -> sparse.csc_matrix:
        """The lower triangle with these entries."""
        return sparse.csc_matrix((entries, self._indices, self._indptr), shape=(self._size, self._size))


def _pressure_moduli(scale: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray:
    """Derivative of p J F^-T: p J (G_ij G_kl - G_il G_kj)."""
    gg = inverse_transpose[..., :, :, None, None] * inverse_transpose[..., None, None, :, :]
    return scale[..., None, None, None, None] * (gg - np.swapaxes(gg, -3, -1))
