"""The neo-Hookean material law, from a network of Gaussian chains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mitsuba_taxel.mechanics.materials.laws.material import POISSON_RATIO, Material
from mitsuba_taxel.parameters import number


@dataclass(frozen=True)
class NeoHookean(Material, name="neo_hookean", rank=1):
    """W = mu/2 (I1 - 3) with mu = E / (2 (1 + nu)), from a network of Gaussian chains.

    Strain energy W of the neo-Hookean law (L. R. G. Treloar, The Physics of Rubber Elasticity, 3rd ed., 1975, chapter
    4; isochoric form: Holzapfel 2000, section 6.5).
    """

    youngs_modulus: float = number(4.16, "MPa", "Young's modulus at small strain.", above=0, common=(0.005, 100))
    poisson_ratio: float = POISSON_RATIO

    def strain_energy(self, i1: Any, i2: Any) -> Any:
        return self.youngs_modulus / (4 * (1 + self.poisson_ratio)) * (i1 - 3)
