"""A law of both invariants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mitsuba_taxel.mechanics.materials.laws.material import COMMON, FALLS, POISSON_RATIO, Material
from mitsuba_taxel.parameters import REQUIRED, number


@dataclass(frozen=True)
class MooneyRivlin(Material, name="mooney_rivlin", rank=2):
    """W = c10 (I1 - 3) + c01 (I2 - 3).

    (M. Mooney, J. Appl. Phys. 11, 582, 1940; R. S. Rivlin, Phil. Trans. R. Soc. A 241, 379, 1948.) Neither constant
    may be negative: the energy would be unbounded below, in uniaxial tension for c10 and in equibiaxial tension for
    c01. Fits to uniaxial tests alone often give such a c01; for these, :class:`Yeoh` is safer.

    The shear modulus is mu = 2 (c10 + c01), and must not be 0.
    """

    c10: float = number(REQUIRED, "MPa", "Constant of I1.", minimum=0, common=COMMON, hint=FALLS.format("uniaxial"))
    c01: float = number(REQUIRED, "MPa", "Constant of I2.", minimum=0, hint=FALLS.format("equibiaxial"))
    poisson_ratio: float = POISSON_RATIO

    def strain_energy(self, i1: Any, i2: Any) -> Any:
        return self.c10 * (i1 - 3) + self.c01 * (i2 - 3)
