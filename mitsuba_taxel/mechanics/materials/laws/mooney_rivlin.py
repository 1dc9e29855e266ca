"""The material law of Mooney and Rivlin, which depends on both strain invariants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mitsuba_taxel.mechanics.materials.drucker import require_stable
from mitsuba_taxel.mechanics.materials.laws.material import COMMON, POISSON_RATIO, Material
from mitsuba_taxel.parameters import REQUIRED, number

FALLS = ", below it the energy falls without bound in uniaxial tension"


@dataclass(frozen=True)
class MooneyRivlin(Material, name="mooney_rivlin", rank=2):
    """W = c10 (I1 - 3) + c01 (I2 - 3).

    Strain energy W of the law of Mooney and Rivlin (M. Mooney, J. Appl. Phys. 11, 582, 1940; R. S. Rivlin, Phil. Trans.
    R. Soc. A 241, 379, 1948). c10 may not be negative: the energy would be unbounded below in uniaxial tension. A
    negative c01, as from fits to uniaxial tests alone, makes it unbounded below in equibiaxial tension. It is allowed
    if stress rises with strain in all modes up to a principal stretch of 1.5; a note on a reading states where a pad is
    stretched beyond the limit.

    The shear modulus is mu = 2 (c10 + c01), and must not be 0.
    """

    c10: float = number(REQUIRED, "MPa", "Constant of I1.", minimum=0, common=COMMON, hint=FALLS)
    c01: float = number(REQUIRED, "MPa", "Constant of I2: 0 or more, or slightly negative.")
    poisson_ratio: float = POISSON_RATIO

    def strain_energy(self, i1: Any, i2: Any) -> Any:
        return self.c10 * (i1 - 3) + self.c01 * (i2 - 3)

    def _check(self) -> None:
        if self.c01 < 0:
            require_stable(self, "c01")
        super()._check()
