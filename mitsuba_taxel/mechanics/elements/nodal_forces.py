"""Nodal internal forces of a deformed pad, without constraints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.elements.internal_variables import StressUpdate
from mitsuba_taxel.mechanics.elements.symmetry import part_between
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.regions import REGIONS

MOST_KEPT = 2**14
"""Largest number of elements that are kept for the next state on the same mesh; each takes 9 kB."""
elements_of = kept(1)(Elements)  # consecutive states of a study share their mesh


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
    stress_update = None if overstress is None else StressUpdate(1.0, overstress, part_between(mesh, {}, ()))
    shared = linear is None and len(mesh.tets) <= MOST_KEPT
    elements = elements_of(mesh, material) if shared else Elements(mesh, material, linear)
    inside = elements.evaluate(displacement, pressure, with_matrices=False, stress_update=stress_update)
    if not inside.min_jacobian > 0:
        return np.full(mesh.points.shape, np.nan)
    degrees = 3 * elements.nodes[:, :, None] + np.arange(3)
    return np.bincount(degrees.ravel(), inside.forces.ravel(), mesh.points.size).reshape(-1, 3)


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


def board_force(mesh: VolumeMesh, material: Material, displacement: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Force of the board on an elastic pad, as :func:`glued_force` gives it, from the elements at the board alone.

    Parameters
    ----------
    mesh, material, displacement, pressure
        See :func:`internal_forces`.

    Returns
    -------
    (3,) ndarray
        Force in N; NaN if an element at the board is inverted.
    """
    glued = np.zeros(len(mesh.points), dtype=bool)
    glued[nodes_of(mesh, "bottom")] = True
    lowest = mesh.tets[glued[mesh.tets].any(axis=1)]
    if not len(lowest):
        return np.zeros(3)
    elements = Elements(replace(mesh, tets=lowest), material)
    state = elements.evaluate(displacement, pressure, with_matrices=False)
    if not state.min_jacobian > 0:
        return np.full(3, np.nan)
    return state.forces[glued[elements.nodes]].sum(axis=0)
