"""Yeoh's material law, which can stiffen at large strains."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from mitsuba_taxel.mechanics.materials.drucker import require_stable
from mitsuba_taxel.mechanics.materials.laws.material import COMMON, POISSON_RATIO, Material
from mitsuba_taxel.parameters import REQUIRED, number


@dataclass(frozen=True)
class Yeoh(Material, name="yeoh", rank=3):
    """W = c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3.

    Strain energy W of Yeoh's law (O. H. Yeoh, Rubber Chem. Technol. 66, 754, 1993; two terms without c30). Negative
    constants are allowed if the energy rises with I1 at any strain, c10 + 2 c20 x + 3 c30 x^2 > 0 for all x >= 0, or if
    stress rises with strain in all modes up to a principal stretch of 1.5; a note on a reading states where a pad is
    stretched beyond the limit.

    The shear modulus is mu = 2 c10.
    """

    c10: float = number(REQUIRED, "MPa", "Constant of I1.", above=0, common=COMMON)
    c20: float = number(0.0, "MPa", "Constant of (I1 - 3)^2: 0 or more, or slightly negative.")
    c30: float = number(0.0, "MPa", "Constant of (I1 - 3)^3: 0 or more, or slightly negative.")
    poisson_ratio: float = POISSON_RATIO

    def strain_energy(self, i1: Any, i2: Any) -> Any:
        return self.c10 * (i1 - 3) + self.c20 * (i1 - 3) ** 2 + self.c30 * (i1 - 3) ** 3

    def _check(self) -> None:
        super()._check()
        if self.c30 >= 0 and self.c20 > -math.sqrt(3 * self.c10 * self.c30):
            return
        for name in ("c20", "c30"):
            if getattr(self, name) < 0:
                require_stable(self, name)
