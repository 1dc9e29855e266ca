"""A law that stiffens at large strain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from mitsuba_taxel.mechanics.materials.laws.material import COMMON, POISSON_RATIO, Material
from mitsuba_taxel.parameters import REQUIRED, number


@dataclass(frozen=True)
class Yeoh(Material, name="yeoh", rank=3):
    """W = c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3.

    (O. H. Yeoh, Rubber Chem. Technol. 66, 754, 1993.) The energy must rise with I1 at any strain, that is,
    c10 + 2 c20 x + 3 c30 x^2 > 0 for all x >= 0; a slightly negative measured c20 is allowed if c30 compensates for
    it.

    The shear modulus is mu = 2 c10.
    """

    c10: float = number(REQUIRED, "MPa", "Constant of I1.", above=0, common=COMMON)
    c20: float = number(0.0, "MPa", "Constant of (I1 - 3)^2: 0 or more, or above -sqrt(3 c10 c30).")
    c30: float = number(
        0.0, "MPa", "Constant of (I1 - 3)^3.", minimum=0, hint=", below it the energy falls at large strain"
    )
    poisson_ratio: float = POISSON_RATIO

    def strain_energy(self, i1: Any, i2: Any) -> Any:
        return self.c10 * (i1 - 3) + self.c20 * (i1 - 3) ** 2 + self.c30 * (i1 - 3) ** 3

    def _check(self) -> None:
        limit = math.sqrt(3 * self.c10 * self.c30)
        rises = f"0 or more, or above -sqrt(3 c10 c30) = {-limit:.4g}, is needed for an energy that rises with strain"
        self._require("c20", self.c20 >= 0 or self.c20 > -limit, rises)
