"""Loads of a pad: their base class, and a file for each kind; every load here is available in scenes under its name."""

from mitsuba_taxel.base.kinds import import_all
from mitsuba_taxel.mechanics.elements.loads.indenter_displacement import IndenterDisplacement
from mitsuba_taxel.mechanics.elements.loads.indenter_force import IndenterForce
from mitsuba_taxel.mechanics.elements.loads.load import DeadForce, Load, mirrored_value, normal_part
from mitsuba_taxel.mechanics.elements.loads.patch_force import PatchForce
from mitsuba_taxel.mechanics.elements.loads.plate_displacement import PlateDisplacement
from mitsuba_taxel.mechanics.elements.loads.plate_force import PlateForce
from mitsuba_taxel.mechanics.elements.loads.plate_wrench import PlateWrench
from mitsuba_taxel.mechanics.elements.loads.pressure import Pressure
from mitsuba_taxel.mechanics.elements.loads.spread_force import SPREAD_FORCE, SpreadForce

__all__ = [
    "SPREAD_FORCE",
    "DeadForce",
    "IndenterDisplacement",
    "IndenterForce",
    "Load",
    "PatchForce",
    "PlateDisplacement",
    "PlateForce",
    "PlateWrench",
    "Pressure",
    "SpreadForce",
    "mirrored_value",
    "normal_part",
]

import_all(__name__, __path__)
