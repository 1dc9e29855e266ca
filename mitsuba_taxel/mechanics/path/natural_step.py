"""The step of a load path that strains a pad by about two percent."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.loads import IndenterDisplacement, Load, PlateDisplacement, Pressure, loaded_area
from mitsuba_taxel.mechanics.materials.laws import Material

THIN_STEP = 0.125
"""Largest step of an indenter, relative to its thickness: one that moves through the surface at once is not felt."""
NATURAL_STRAIN = 0.02
"""Approximate mean strain of one step of a load path."""


def natural_step(mesh: VolumeMesh, material: Material, load: Load) -> float:
    """Step of a load path: change of a load's value (N, mm or MPa) that strains the pad by about `NATURAL_STRAIN`."""
    strained = NATURAL_STRAIN * float(np.ptp(mesh.points[:, 2]))
    if isinstance(load, PlateDisplacement):
        return strained
    if isinstance(load, IndenterDisplacement):  # most of the pad is strained less
        return min(2 * strained, THIN_STEP * load.indenter.thickness)
    stress = NATURAL_STRAIN * material.youngs_modulus
    return stress if isinstance(load, Pressure) else stress * loaded_area(mesh, load)
