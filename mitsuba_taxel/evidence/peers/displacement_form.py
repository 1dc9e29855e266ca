"""The quadratic tetrahedron with displacement unknowns only and four quadrature points, as CalculiX's element C3D10.

It verifies the results of CalculiX node by node. It locks near incompressibility, and is therefore not a reference for
true displacements.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.quadratic_shapes import shape_gradients
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.solvers import make_solver
from mitsuba_taxel.mechanics.materials.laws import NeoHookean
from mitsuba_taxel.pads import REGIONS

# Exact to degree 2, a quarter of the volume for each point (P. C. Hammer and A. H. Stroud, Math. Comput. 10, 1956).
QUADRATURE_POINTS = (5 - 5**0.5) / 20 + 5**-0.5 * np.concatenate([np.zeros((1, 3)), np.eye(3)])
QUADRATURE_WEIGHT = 1 / 24

RESIDUAL_TOLERANCE = 1e-10
"""Largest out-of-balance force accepted, relative to the load."""
MOST_ITERATIONS = 20
LEAST_STEP = 1 / 64
"""Smallest fraction of the load per step."""


def solve(mesh: VolumeMesh, material: NeoHookean, force: Sequence[float]) -> np.ndarray:
    """Compute the displacement (N, 3) in mm of the N nodes of a pad that is glued to the board, under a dead load
    spread over its undeformed top.

    Newton's method applies the whole load in one step; if this fails, in halves, quarters and so on.

    Parameters
    ----------
    force : sequence of float
        Total force (Fx, Fy, Fz) in N.

    Raises
    ------
    InputError
        if the material is incompressible.
    ComputationError
        if no equilibrium is found under the load.
    """
    element, load = DisplacementForm(mesh, material), nodal_forces(mesh, force)
    displacement, fraction, step = np.zeros_like(mesh.points), 0.0, 1.0
    while fraction < 1:
        try:
            displacement = element.equilibrium(displacement, (fraction + step) * load)
            fraction += step
        except ComputationError:
            step /= 2
            if step < LEAST_STEP:
                raise
    return displacement


def held(mesh: VolumeMesh) -> np.ndarray:
    """Mask (N,) of the nodes of a pad that are glued to the board."""
    glued = np.zeros(len(mesh.points), dtype=bool)
    glued[mesh.faces[mesh.face_region == REGIONS["bottom"]]] = True
    return glued


def nodal_forces(mesh: VolumeMesh, force: Sequence[float]) -> np.ndarray:
    """Consistent nodal forces of a load spread over the top of a pad: each mid-edge node takes a third of the force on
    its flat six-node triangle.

    Parameters
    ----------
    mesh : VolumeMesh
        The undeformed mesh.
    force : sequence of float
        Total force (Fx, Fy, Fz) in N, spread over the top.

    Returns
    -------
    (N, 3) ndarray
        Forces on the N nodes, in N.
    """
    top = mesh.faces[mesh.face_region == REGIONS["top"]]
    a, b, c = (mesh.points[top[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    nodal_area = np.bincount(top[:, 3:].ravel(), weights=np.repeat(area, 3), minlength=len(mesh.points))
    return nodal_area[:, None] / nodal_area.sum() * np.asarray(force)


def bulk_modulus(material: NeoHookean) -> float:
    """Bulk modulus in MPa; raises `InputError` for an incompressible material, which this element cannot represent."""
    if material.compressibility == 0:
        raise InputError(f"poisson_ratio = {material.poisson_ratio} is not allowed: a number below 0.5 is needed.")
    return 1 / material.compressibility


class DisplacementForm:
    """Finite-element solver for the strain energy W = mu/2 (I1 J^(-2/3) - 3) + kappa/2 (J - 1)^2, in total Lagrangian
    form, vectorised over elements."""

    def __init__(self, mesh: VolumeMesh, material: NeoHookean) -> None:
        self._mesh, self._material, self._bulk_modulus = mesh, material, bulk_modulus(material)
        reference = shape_gradients(QUADRATURE_POINTS)
        jacobian = np.einsum("qai,maj->mqji", reference, mesh.points[mesh.tets])
        self._weight = np.linalg.det(jacobian) * QUADRATURE_WEIGHT
        self._gradients = np.einsum("qai,mqij->mqaj", reference, np.linalg.inv(jacobian))
        self._free = np.flatnonzero(~np.repeat(held(mesh), 3))
        unknown_of = np.full(mesh.points.size, -1)
        unknown_of[self._free] = np.arange(len(self._free))
        self._unknowns = unknown_of[(3 * mesh.tets[:, :, None] + np.arange(3)).reshape(-1, 30)]
        self._solver = make_solver()

    def equilibrium(self, start: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Compute the displacement (N, 3) of the N nodes in equilibrium with nodal forces ``load`` (N, 3), by Newton's
        method from ``start`` (N, 3).

        Raises
        ------
        ComputationError
            if Newton's method does not converge, or inverts an element.
        """
        displacement = start.copy()
        for _ in range(MOST_ITERATIONS):
            forces, tangent = self.linearised(displacement)
            residual = forces - load.ravel()[self._free]
            if np.linalg.norm(residual) < RESIDUAL_TOLERANCE * np.linalg.norm(load):
                return displacement
            displacement.ravel()[self._free] -= self._solver.factor(tangent).solve(residual)
        raise ComputationError(f"Newton's method fails in {MOST_ITERATIONS} iterations: a smaller load is needed.")

    def linearised(self, displacement: np.ndarray) -> tuple[np.ndarray, sparse.csc_matrix]:
        """Internal forces in N on the free degrees of freedom, and the lower triangle of the tangent."""
        gradient = np.einsum("mai,mqaj->mqij", displacement[self._mesh.tets], self._gradients) + np.eye(3)
        determinant = np.linalg.det(gradient)
        if not determinant.min() > 0:
            raise ComputationError(f"an element would be inverted (J = {determinant.min():.2g}): take smaller steps.")
        stress, moduli = self._response(gradient, determinant)
        weighted = self._weight[..., None, None] * self._gradients
        forces = (weighted @ np.swapaxes(stress, -1, -2)).sum(axis=1)
        return self._assembled(forces.reshape(-1, 30), _stiffness(weighted, moduli, self._gradients))

    def _response(self, gradient: np.ndarray, determinant: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Material response: the first Piola-Kirchhoff stress (..., 3, 3) in MPa, and its derivative (..., 3, 3, 3, 3)
        with respect to the deformation gradient."""
        g = np.swapaxes(np.linalg.inv(gradient), -1, -2)
        scale = (self._bulk_modulus * (determinant - 1) * determinant)[..., None, None]
        slope = (self._bulk_modulus * (2 * determinant - 1) * determinant)[..., None, None, None, None]
        gg = g[..., :, :, None, None] * g[..., None, None, :, :]
        stress = self._material.stress(gradient, determinant, g) + scale * g
        moduli = self._material.tangent(gradient, determinant, g)
        moduli += slope * gg - scale[..., None, None] * np.swapaxes(gg, -3, -1)
        return stress, moduli

    def _assembled(self, forces: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, sparse.csc_matrix]:
        count, numbers = len(self._free), self._unknowns
        free = numbers >= 0
        assembled = np.bincount(numbers[free], weights=forces[free], minlength=count)
        rows, columns = np.broadcast_arrays(numbers[:, :, None], numbers[:, None, :])
        kept = (rows >= columns) & (columns >= 0)
        entries = (stiffness[kept], (rows[kept], columns[kept]))
        return assembled, sparse.csc_matrix(entries, shape=(count, count))


def _stiffness(weighted: np.ndarray, moduli: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    """Element stiffness matrices (m, 30, 30) of m elements: the sum over quadrature points q and components j, l of w
    B_aj A_ijkl B_bl, as two batched matrix products."""
    count, points = weighted.shape[:2]
    right_factor = moduli.reshape(count, points, 27, 3) @ np.swapaxes(gradients, -1, -2)
    right_factor = right_factor.reshape(count, points, 3, 3, 3, 10).transpose(0, 1, 3, 2, 5, 4)  # (m, q, j, i, b, k)
    left_factor = weighted.transpose(0, 2, 1, 3).reshape(count, 10, 3 * points)
    return (left_factor @ right_factor.reshape(count, 3 * points, 90)).reshape(count, 30, 30)
