"""Corners of a pad's top under a spread force, which turn over by themselves from some pressure on."""

from __future__ import annotations

import math

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.rim_corners import has_right_angled_top
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.materials.corner_limit import corner_limit
from mitsuba_taxel.mechanics.materials.laws import Material

HARMLESS = 0.2
"""Pressure in shear moduli up to which corners are not looked at: those of silicones bear 0.4 to 1.2."""


def gives_way(force: float, mesh: VolumeMesh, material: Material, load: Load) -> float:
    """Pressure in MPa at which corners of the top give way, if a load presses with more; infinite if not.

    Parameters
    ----------
    force : float
        In N, with which the load presses.
    """
    if not load.loads_rim:
        return math.inf
    pressure = force / load.loaded_area(mesh)
    if pressure < HARMLESS * material.shear_modulus or not has_right_angled_top(mesh):
        return math.inf
    limit = corner_limit(material)
    return limit if pressure > limit else math.inf
