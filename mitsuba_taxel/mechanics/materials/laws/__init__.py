"""Laws of rubber-like solids: the base class, and one file for each law; scenes know every law under its name."""

from mitsuba_taxel.base.kinds import import_all
from mitsuba_taxel.mechanics.materials.laws.arruda_boyce import ArrudaBoyce
from mitsuba_taxel.mechanics.materials.laws.material import Material
from mitsuba_taxel.mechanics.materials.laws.mooney_rivlin import MooneyRivlin
from mitsuba_taxel.mechanics.materials.laws.neo_hookean import NeoHookean
from mitsuba_taxel.mechanics.materials.laws.ogden import Ogden
from mitsuba_taxel.mechanics.materials.laws.yeoh import Yeoh

__all__ = ["ArrudaBoyce", "Material", "MooneyRivlin", "NeoHookean", "Ogden", "Yeoh"]

import_all(__name__, __path__)
