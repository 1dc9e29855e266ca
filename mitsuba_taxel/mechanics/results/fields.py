"""Strain and stress at the nodes of a deformed pad."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import TET_EDGES, VolumeMesh
from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.locate import displacement_gradient
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.viscoelastic import tensors


@dataclass(frozen=True, eq=False)
class NodalFields:
    """Fields of a deformed pad at its nodes, all from one deformation gradient and one pressure per node.

    The deformation gradient of a node is the mean of those in the elements around it. Where J <= 0, a sign that the
    mesh is too coarse there, stresses are NaN.

    Attributes
    ----------
    deformation_gradient : (N, 3, 3) ndarray
        F = 1 + grad u.
    pressure : (N,) ndarray
        Mean of the principal Cauchy stresses in MPa, positive in tension, as in :class:`State`.
    material : Material
        The law of the isochoric stress.
    relaxed : (N, 3, 3) ndarray or None
        Isochoric second Piola-Kirchhoff stress of a viscoelastic silicone in MPa, the mean over the elements around the
        node; None for other materials.
    """

    deformation_gradient: np.ndarray
    pressure: np.ndarray
    material: Material
    relaxed: np.ndarray | None = None

    @cached_property
    def volume_ratio(self) -> np.ndarray:
        """Volume ratio J = det F (N,) at the nodes: deformed volume over undeformed volume."""
        return np.linalg.det(self.deformation_gradient)

    @cached_property
    def principal_stretches(self) -> np.ndarray:
        """Principal stretches (N, 3) at the nodes, the largest first: the singular values of the deformation gradient
        F.
        """
        return np.linalg.svd(self.deformation_gradient, compute_uv=False)

    @cached_property
    def cauchy_stress(self) -> np.ndarray:
        """Cauchy stress (N, 3, 3) in MPa: sigma = P_iso F^T / J + p 1, with the isochoric first Piola-Kirchhoff stress
        P_iso.

        G. A. Holzapfel, Nonlinear Solid Mechanics, 2000, sections 3.1 and 6.4.
        """
        stress = np.full(self.deformation_gradient.shape, np.nan)
        upright = self.volume_ratio > 0
        gradient, determinant = self.deformation_gradient[upright], self.volume_ratio[upright]
        inverse_transpose = np.swapaxes(np.linalg.inv(gradient), 1, 2)
        if self.relaxed is None:
            first = self.material.stress(gradient, determinant, inverse_transpose)
        else:
            first = gradient @ self.relaxed[upright]
        isochoric = first @ np.swapaxes(gradient, 1, 2)
        stress[upright] = isochoric / determinant[:, None, None] + self.pressure[upright, None, None] * np.eye(3)
        return stress

    @cached_property
    def von_mises_stress(self) -> np.ndarray:
        """Von Mises stress (N,) in MPa: sqrt(3/2 s : s) of the deviatoric Cauchy stress s."""
        mean = np.trace(self.cauchy_stress, axis1=1, axis2=2) / 3
        deviator = self.cauchy_stress - mean[:, None, None] * np.eye(3)
        return np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))


def nodal_fields(
    mesh: VolumeMesh,
    displacement: np.ndarray,
    pressure: np.ndarray,
    material: Material,
    overstress: np.ndarray | None = None,
) -> NodalFields:
    """Strain and stress at the nodes of a deformed pad.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    displacement : (N, 3) ndarray
        Displacement of each node, in mm.
    pressure : (corners,) ndarray
        Pressure at the corners of elements in MPa, positive in tension; it is linear in between.
    material : Material
        Elastic law of the silicone.
    overstress : (m, q, 6) ndarray, optional
        Overstress of a viscoelastic silicone in MPa, see :attr:`ViscoelasticMemory.overstress`.

    Returns
    -------
    NodalFields
        Deformation gradient, pressure, and the derived fields, at each node.
    """
    everywhere = np.empty(len(mesh.points))
    everywhere[: mesh.corner_count] = pressure
    everywhere[mesh.tets[:, 4:]] = pressure[mesh.tets[:, np.array(TET_EDGES)]].mean(axis=2)
    gradient = np.eye(3) + displacement_gradient(mesh, displacement)
    relaxed = None
    if overstress is not None:
        stress = Elements(mesh, material).isochoric_stress(displacement) + overstress
        relaxed = _around_nodes(mesh, tensors(stress.mean(axis=1)))
    return NodalFields(gradient, everywhere, material, relaxed)


def _around_nodes(mesh: VolumeMesh, tensors: np.ndarray) -> np.ndarray:
    """Mean tensor (N, 3, 3) at each of N nodes: the mean of the tensors (m, 3, 3) of the elements around it."""
    total = np.zeros((len(mesh.points), 3, 3))
    np.add.at(total, mesh.tets, tensors[:, None])
    return total / np.bincount(mesh.tets.ravel(), minlength=len(total))[:, None, None]
