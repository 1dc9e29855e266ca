"""Nodal internal forces of a deformed pad, without constraints."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.elements.internal_variables import StressUpdate
from mitsuba_taxel.mechanics.elements.symmetry import part_between
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.regions import REGIONS


def internal_forces(
    mesh: VolumeMesh,
    material: Material,
    displacement: np.ndarray,
    pressure: np.ndarray,
    overstress: np.ndarray | None = None,
    linear: np.ndarray | None = None,
) -> np.ndarray:
    """Internal forces of the elements at each node.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    material : Material
        Elastic law.
    displacement : (N, 3) ndarray
        Displacement of the nodes, mm.
    pressure : (corners,) ndarray
        Pressure at each corner of the elements in MPa, positive in tension.
    overstress : (m, q, 6) ndarray, optional
        Viscoelastic stress in addition to the stress of the material, MPa.
    linear : (m, q) ndarray of bool, optional
        Quadrature points where the law is linear.

    Returns
    -------
    (N, 3) ndarray
        Forces in N.
    """
    nodes = len(mesh.points)
    unconstrained = number_unknowns(mesh, np.zeros(nodes, dtype=bool))
    stress_update = None if overstress is None else StressUpdate(1.0, overstress, part_between(mesh, {}, ()))
    assembly = Assembly(mesh, material, unconstrained, linear=linear)
    inside = assembly.evaluate(displacement, pressure, with_tangent=False, stress_update=stress_update)
    return inside.residual[: 3 * nodes].reshape(-1, 3)


def nodes_of(mesh: VolumeMesh, region: str) -> np.ndarray:
    """Numbers of the nodes on a region of the surface.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    region : str
        Name of a region of the surface.

    Returns
    -------
    (k,) ndarray of int
        Numbers in ascending order.
    """
    return np.unique(mesh.faces[mesh.face_region == REGIONS[region]])


def glued_force(
    mesh: VolumeMesh,
    material: Material,
    displacement: np.ndarray,
    pressure: np.ndarray,
    overstress: np.ndarray | None = None,
    region: str = "bottom",
    linear: np.ndarray | None = None,
) -> np.ndarray:
    """Force on the pad at a region where it is glued.

    Parameters
    ----------
    mesh, material, displacement, pressure, overstress, linear
        See :func:`internal_forces`.
    region : str
        Name of the region, on which no other force acts.

    Returns
    -------
    (3,) ndarray
        Force in N.
    """
    forces = internal_forces(mesh, material, displacement, pressure, overstress, linear)
    return forces[nodes_of(mesh, region)].sum(axis=0)
