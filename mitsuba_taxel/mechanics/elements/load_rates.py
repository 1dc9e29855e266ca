"""Derivatives of the nodal forces of a load with respect to the undeformed nodes, at constant displacements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.indentation import Indentation
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.elements.pressure import pressure_forces, wet_faces
from mitsuba_taxel.mechanics.materials.laws import Material

LOAD_STEP = 1e-4
"""Largest movement of a node, relative to the height of the mesh, for finite differences of a distributed load."""


def load_rate(
    mesh: VolumeMesh, material: Material, load: Load, displacement: np.ndarray, value: np.ndarray, velocity: np.ndarray
) -> np.ndarray:
    """Derivative of the nodal forces of a load on a whole pad with respect to a shape parameter.

    A spread force keeps its total, a patch its position in space, a pressure follows the surface, an indenter keeps its
    height above the pad; loads on a bonded plate do not change.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    material : Material
        Elastic law, which determines the contact stiffness.
    load : Load
        Load on the pad.
    displacement : (N, 3) ndarray
        Displacement of the nodes, mm.
    value : ndarray
        Value of the load.
    velocity : (N, 3) ndarray
        Movement of the undeformed nodes in mm per unit of a parameter.

    Returns
    -------
    (N, 3) ndarray
        Derivative of the forces in N per unit of that parameter.
    """
    if load.follows_surface:
        faces, rate = wet_faces(mesh), np.zeros_like(displacement)
        positions, moves = (mesh.points + displacement)[faces], velocity[faces]
        # forces are quadratic in the positions, so that this difference is exact
        np.add.at(rate, faces, 0.5 * (pressure_forces(positions + moves) - pressure_forces(positions - moves)))
        return value[0] * rate
    if load.moved_indenter is not None:
        body = Indentation(mesh, load.moved_indenter, material.youngs_modulus)
        return body.shape_rate(displacement, value, velocity)
    fastest = float(np.abs(velocity).max(initial=0.0))
    if not load.dead or fastest == 0:
        return np.zeros_like(displacement)

    # The distribution of a dead force, by a central difference of fourth order.
    step = LOAD_STEP * float(np.ptp(mesh.points[:, 2])) / fastest

    def distribution(steps: int) -> np.ndarray:
        nodal = load.nodal(replace(mesh, points=mesh.points + steps * step * velocity))
        return nodal / nodal.sum()

    ahead, behind, ahead_2, behind_2 = (distribution(steps) for steps in (1, -1, 2, -2))
    return (8 * (ahead - behind) - (ahead_2 - behind_2))[:, None] / (12 * step) * value
