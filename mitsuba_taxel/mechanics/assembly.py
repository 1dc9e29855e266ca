"""Taylor-Hood finite elements for finite strain: residual and tangent, vectorised over elements.

Displacements are quadratic, the pressure linear on each tetrahedron (total Lagrangian, perturbed Lagrangian)::

    Pi(u, p) = int W_iso(F) + p (J - 1) - p^2 / (2 kappa) dV - f . u,    F = 1 + grad u,  J = det F

(G. A. Holzapfel, Nonlinear Solid Mechanics, 2000, section 8.3). The constitutive law is asked for its isochoric
stress and tangent only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.pads.quality import shape_gradients
from mitsuba_taxel.pads.volume_mesh import VolumeMesh


class Material(Protocol):
    """What the assembly asks of a constitutive law; gradients are (..., 3, 3)."""

    @property
    def youngs_modulus(self) -> float: ...

    @property
    def compressibility(self) -> float: ...

    def stress(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray: ...

    def tangent(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray: ...


# Eight points (F. D. Witherden and P. E. Vincent, Comput. Math. Appl. 69, 2015), exact to degree 3 as the forces of a
# homogeneous state need on curved elements: four points, exact to degree 2, fail the patch test there.
_NEAR_FACES, _NEAR_CORNERS = 0.3281633025163817, 0.1080472498984286
QUADRATURE_POINTS = np.concatenate(
    [a + (1 - 4 * a) * np.concatenate([np.zeros((1, 3)), np.eye(3)]) for a in (_NEAR_FACES, _NEAR_CORNERS)]
)
QUADRATURE_WEIGHTS = np.repeat([0.1362178425370874, 0.1137821574629126], 4) / 6


ELEMENTS_AT_ONCE = 256


@dataclass(frozen=True)
class Configuration:
    """Residual and tangent at a state, and what they were made of."""

    residual: np.ndarray
    tangent: sparse.csc_matrix | None
    min_jacobian: float


class Assembly:
    """Residual and tangent of a mesh and a material; unknowns are the free displacements, then the pressures.

    Parameters
    ----------
    fixed : (N,) whether each node is held
    """

    def __init__(self, mesh: VolumeMesh, material: Material, fixed: np.ndarray) -> None:
        self.mesh, self.material = mesh, material
        reference = shape_gradients(QUADRATURE_POINTS)
        x = mesh.points[mesh.tets]
        jacobian = np.einsum("qai,maj->mqji", reference, x)
        self.weight = np.linalg.det(jacobian) * QUADRATURE_WEIGHTS
        self.gradients = np.einsum("qai,mqij->mqaj", reference, np.linalg.inv(jacobian))
        self.pressure_shapes = np.concatenate(
            [1 - QUADRATURE_POINTS.sum(axis=1, keepdims=True), QUADRATURE_POINTS], axis=1
        )
        self._number_unknowns(fixed)
        self._prepare_pattern()

    def _number_unknowns(self, fixed: np.ndarray) -> None:
        nodes = len(self.mesh.points)
        self.free = np.flatnonzero(~np.repeat(fixed, 3))
        self.unknown_of = np.full(3 * nodes + self.mesh.corner_count, -1)
        self.unknown_of[self.free] = np.arange(len(self.free))
        self.pressures = self.mesh.corner_count
        self.unknowns = len(self.free) + self.pressures
        self.unknown_of[3 * nodes :] = len(self.free) + np.arange(self.pressures)
        displacement = (3 * self.mesh.tets[:, :, None] + np.arange(3)).reshape(len(self.mesh.tets), 30)
        pressure = 3 * nodes + self.mesh.tets[:, :4]
        self.element_unknowns = self.unknown_of[np.concatenate([displacement, pressure], axis=1)]

    def _prepare_pattern(self) -> None:
        """Where each entry of the lower triangle of each element's matrix goes in the sparse one."""
        rows, columns = (
            index.reshape(len(self.element_unknowns), -1)
            for index in np.broadcast_arrays(self.element_unknowns[:, :, None], self.element_unknowns[:, None, :])
        )
        self._kept = np.flatnonzero((rows >= columns) & (columns >= 0))
        key = columns.ravel()[self._kept].astype(np.int64) * self.unknowns + rows.ravel()[self._kept]
        unique, self._target = np.unique(key, return_inverse=True)
        self._indices = (unique % self.unknowns).astype(np.int32)
        counts = np.bincount(unique // self.unknowns, minlength=self.unknowns)
        self._indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)

    def split(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (N, 3) and pressure (corners,) of a vector of unknowns."""
        displacement = np.zeros(3 * len(self.mesh.points))
        displacement[self.free] = unknowns[: len(self.free)]
        return displacement.reshape(-1, 3), unknowns[len(self.free) :]

    def evaluate(self, displacement: np.ndarray, pressure: np.ndarray, with_tangent: bool = True) -> Configuration:
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
            return Configuration(np.full(self.unknowns, np.nan), None, least)
        inverse_transpose = np.swapaxes(np.linalg.inv(gradient), -1, -2)
        p = pressure[self.mesh.tets[:, :4]] @ self.pressure_shapes.T
        cofactor = determinant[..., None, None] * inverse_transpose
        stress = self.material.stress(gradient, determinant, inverse_transpose) + p[..., None, None] * cofactor
        residual = self._residual(stress, determinant, p)
        tangent = self._tangent(gradient, determinant, inverse_transpose, p) if with_tangent else None
        return Configuration(residual, tangent, least)

    def _residual(self, stress: np.ndarray, determinant: np.ndarray, p: np.ndarray) -> np.ndarray:
        forces = np.einsum("mq,mqij,mqaj->mai", self.weight, stress, self.gradients, optimize=True)
        volume = self.weight * (determinant - 1 - self.material.compressibility * p)
        constraint = volume @ self.pressure_shapes
        element = np.concatenate([forces.reshape(len(forces), 30), constraint], axis=1)
        free = self.element_unknowns >= 0
        return np.bincount(self.element_unknowns[free], weights=element[free], minlength=self.unknowns)

    def _tangent(
        self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray, p: np.ndarray
    ) -> sparse.csc_matrix:
        """Lower triangle of the tangent, from a few elements at a time, as many as the processor's cache holds."""
        matrix = np.empty((len(p), 34, 34))
        for start in range(0, len(p), ELEMENTS_AT_ONCE):
            here = slice(start, start + ELEMENTS_AT_ONCE)
            state = (gradient[here], determinant[here], inverse_transpose[here])
            moduli = self.material.tangent(*state)
            moduli += _pressure_moduli(p[here] * determinant[here], inverse_transpose[here])
            cofactor = determinant[here, :, None, None] * inverse_transpose[here]
            self._fill(matrix[here], self.weight[here], self.gradients[here], moduli, cofactor)
        data = np.bincount(self._target, weights=matrix.reshape(-1)[self._kept], minlength=len(self._indices))
        return sparse.csc_matrix((data, self._indices, self._indptr), shape=(self.unknowns, self.unknowns))

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


def _pressure_moduli(scale: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray:
    """Derivative of p J F^-T: p J (G_ij G_kl - G_il G_kj)."""
    gg = inverse_transpose[..., :, :, None, None] * inverse_transpose[..., None, None, :, :]
    return scale[..., None, None, None, None] * (gg - np.swapaxes(gg, -3, -1))
