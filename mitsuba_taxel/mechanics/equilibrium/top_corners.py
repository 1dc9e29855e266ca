"""Corners between the top of a pad and its sides, which become unstable under a load of constant direction."""

from __future__ import annotations

import math

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.singular_edges import has_right_angled_top
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.materials.corner_limit import corner_limit
from mitsuba_taxel.mechanics.materials.laws import Material

HARMLESS = 0.2
"""Pressure, relative to the shear modulus, up to which corners are not tested: corners of silicones bear 0.4 to 1.2."""


def gives_way(force: float, mesh: VolumeMesh, material: Material, load: Load) -> float:
    """Pressure in MPa on the top at which its sharp corners become unstable; infinite if they are stable under this
    load.

    Parameters
    ----------
    force : float
        Force of the load in N, downwards.
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    material : Material
        Elastic law of the silicone.
    load : Load
        Kind of load.

    Returns
    -------
    float
        Pressure in MPa; infinite if the corners are stable.
    """
    if not load.loads_rim:
        return math.inf
    pressure = force / load.loaded_area(mesh)
    if pressure < HARMLESS * material.shear_modulus or not has_right_angled_top(mesh):
        return math.inf
    limit = corner_limit(material)
    return limit if pressure > limit else math.inf
