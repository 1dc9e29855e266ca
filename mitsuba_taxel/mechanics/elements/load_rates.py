"""Rates of the nodal forces of a load with the undeformed nodes, at constant displacements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.indentation import Indentation
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.elements.pressure import pressure_forces, wet_faces
from mitsuba_taxel.mechanics.materials.laws import Material

LOAD_STEP = 1e-4
"""Largest displacement of a node, relative to the mesh's height, for finite differences of load shares."""


def load_rate(
    mesh: VolumeMesh, material: Material, load: Load, displacement: np.ndarray, value: np.ndarray, velocity: np.ndarray
) -> np.ndarray:
    """(N, 3) rate of the nodal forces of a load on a whole pad.

    A spread force keeps its total, a patch its position in space, a pressure follows the surface, an indenter keeps its
    height above the pad; loads on a bonded plate do not change.
    """
    if load.follows_surface:
        faces, rate = wet_faces(mesh), np.zeros_like(displacement)
        places, moves = (mesh.points + displacement)[faces], velocity[faces]
        # forces are quadratic in the positions, so that this difference is exact
        np.add.at(rate, faces, 0.5 * (pressure_forces(places + moves) - pressure_forces(places - moves)))
        return value[0] * rate
    if load.moved_indenter is not None:
        body = Indentation(mesh, load.moved_indenter, material.youngs_modulus)
        return body.shape_rate(displacement, value, velocity)
    fastest = float(np.abs(velocity).max(initial=0.0))
    if not load.dead or fastest == 0:
        return np.zeros_like(displacement)
    step = LOAD_STEP * float(np.ptp(mesh.points[:, 2])) / fastest
    ahead, behind, further, back = (_share(mesh, load, k * step * velocity) for k in (1, -1, 2, -2))
    return (8 * (ahead - behind) - (further - back))[:, None] / (12 * step) * value


def _share(mesh: VolumeMesh, load: Load, moves: np.ndarray) -> np.ndarray:
    nodal = load.nodal(replace(mesh, points=mesh.points + moves))
    return nodal / nodal.sum()
