"""The eight-chain material law of Arruda and Boyce, whose chains stiffen towards their full length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mitsuba_taxel.mechanics.materials.laws.material import COMMON, POISSON_RATIO, Material
from mitsuba_taxel.parameters import REQUIRED, number

LANGEVIN = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
"""Coefficients of the inverse Langevin function's series, integrated."""


@dataclass(frozen=True)
class ArrudaBoyce(Material, name="arruda_boyce", rank=4):
    """W = chain_modulus times the sum of C_i (I1^i - 3^i) / locking_stretch^(2 i - 2), i = 1 to 5.

    Strain energy W of eight chains along the diagonals of a cube, each of which stiffens towards its full length; C_i
    are 1/2, 1/20, 11/1050, 19/7000 and 519/673750. (E. M. Arruda and M. C. Boyce, J. Mech. Phys. Solids 41, 389, 1993.)
    Five terms are softer than the chains by 0.5 % at 0.6 of the locking stretch, 2.4 % at 0.7 and 10 % at 0.8.

    The shear modulus is somewhat larger than `chain_modulus`: 2 dW/dI1 at I1 = 3.
    """

    chain_modulus: float = number(REQUIRED, "MPa", "Density of chains times k T.", above=0, common=COMMON)
    locking_stretch: float = number(
        REQUIRED, "", "Ratio of the full length of a chain to its length at rest.", above=1, common=(1.05, 50)
    )
    poisson_ratio: float = POISSON_RATIO

    def strain_energy(self, i1: Any, i2: Any) -> Any:
        return self.chain_modulus * sum(
            c * (i1**i - 3**i) / self.locking_stretch ** (2 * i - 2) for i, c in enumerate(LANGEVIN, 1)
        )
