"""Strain energies of rubber-like solids, split for the mixed formulation.

A law is a strain energy W(I1, I2) of the isochoric invariants; stress, tangent and small-strain moduli are derived from
it. The volumetric energy kappa/2 (J - 1)^2 is treated separately, by a pressure field p and 1/kappa, so that an
incompressible solid (nu = 0.5, 1/kappa = 0) is exact. A new law is a dataclass with its energy::

    @dataclass(frozen=True)
    class Gent(Material):
        mu: float
        limit: float
        poisson_ratio: float = 0.49

        def strain_energy(self, i1, i2):
            return -self.mu * self.limit / 2 * np.log(1 - (i1 - 3) / self.limit)

No field may be named ``shear_modulus`` or ``compressibility``, which are derived.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import is_number
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.invariants import IsochoricInvariants
from mitsuba_taxel.mechanics.materials.jets import Jet
from mitsuba_taxel.mechanics.materials.moduli import Moduli
from mitsuba_taxel.parameters import REQUIRED, Checked, check, number

_POISSON_RATIO: Any = number(0.49, "", "Poisson's ratio; 0.5 is incompressible.", minimum=0, maximum=0.5)
_COMMON = (0.0005, 20)
_FALLS = ", below it the energy falls without bound in {} tension"


class Material(ABC, Checked, Displayed):
    """A rubber-like solid. Its laws are frozen dataclasses whose fields are numbers, ``poisson_ratio`` among them.

    Raises
    ------
    InputError
        if a field is not a finite number, Poisson's ratio is not from 0 to 0.5, or the shear modulus is not above 0.
    """

    poisson_ratio: float

    @abstractmethod
    def strain_energy(self, i1: Any, i2: Any) -> Any:
        """W [MPa] of the isochoric invariants i1 = I1 J^(-2/3) and i2 = I2 J^(-4/3), both 3 at rest.

        Written with ``+ - * / **`` and ``np.log``, ``np.exp``, ``np.sqrt``, ``np.square``.
        """

    def __post_init__(self) -> None:
        check(self)
        for name in self.parameters:
            self._require(name, True, "a finite number is needed")
        self._require("poisson_ratio", 0 <= self.poisson_ratio <= 0.5, "a number from 0 to 0.5 is needed")
        self._check()

    def _check(self) -> None:
        """Refuse finite parameters of an inadmissible material; laws may extend this."""
        self._require("shear_modulus", self.shear_modulus > 0, "a finite number above 0 is needed")

    def _require(self, name: str, condition: bool, needed: str) -> None:
        value = getattr(self, name)
        if not (condition and is_number(value)):
            raise InputError(f"{name} = {value} is not allowed: {needed}.")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the law's numbers, each of which :meth:`changed` changes."""
        return tuple(field.name for field in fields(self))  # type: ignore[arg-type]

    def changed(self, **parameters: float) -> Material:
        """The same law with other parameters."""
        return replace(self, **parameters)  # type: ignore[type-var]

    @property
    def shear_modulus(self) -> float:
        """mu = 2 (dW/dI1 + dW/dI2) at rest, in MPa (Holzapfel 2000, section 6.5)."""
        rest = self._at_rest
        return 2 * ((rest.d1 or 0.0) + (rest.d2 or 0.0))

    @property
    def youngs_modulus(self) -> float:
        """E = 2 mu (1 + nu) at small strain, in MPa."""
        return 2 * self.shear_modulus * (1 + self.poisson_ratio)

    @property
    def compressibility(self) -> float:
        """1 / kappa = 3 (1 - 2 nu) / E in 1/MPa; 0 if incompressible."""
        return 3 * (1 - 2 * self.poisson_ratio) / self.youngs_modulus

    def energy(self, gradient: np.ndarray) -> np.ndarray:
        """Isochoric energy density [MPa] for deformation gradients (..., 3, 3)."""
        inverse_transpose = np.swapaxes(np.linalg.inv(gradient), -1, -2)
        invariants = IsochoricInvariants(gradient, np.linalg.det(gradient), inverse_transpose)
        return self.strain_energy(invariants.first, invariants.second)

    def stress(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray:
        """First Piola-Kirchhoff stress [MPa], (..., 3, 3), of the isochoric energy: W1 dI1/dF + W2 dI2/dF.

        Parameters
        ----------
        gradient : ndarray
            F (..., 3, 3).
        determinant : ndarray
            Det F (...), above 0.
        inverse_transpose : ndarray
            F^-T (..., 3, 3).
        """
        invariants = IsochoricInvariants(gradient, determinant, inverse_transpose)
        w = self._derivatives(invariants)
        return _combination(w.d1, w.d2, invariants)

    def tangent(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray:
        """Derivative dP_ij/dF_kl [MPa], (..., 3, 3, 3, 3), of :meth:`stress`, from the same arguments."""
        return self.moduli(gradient, determinant, inverse_transpose, np.zeros_like(determinant)).dense()

    def moduli(
        self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray, pressure: np.ndarray
    ) -> Moduli:
        """Derivative of :meth:`stress` and of ``pressure`` (...) [MPa] times d(det F)/dF, as a sum of few tensors."""
        invariants = IsochoricInvariants(gradient, determinant, inverse_transpose)
        w = self._derivatives(invariants)
        moduli = invariants.curvature(w.d1, w.d2, pressure * determinant)
        if w.d11 is not None or w.d12 is not None:
            half = None if w.d11 is None else 0.5 * w.d11
            moduli.pairs.append((invariants.first_derivative, _combination(half, w.d12, invariants)))
        if w.d22 is not None:
            moduli.pairs.append((invariants.second_derivative, _combination(None, 0.5 * w.d22, invariants)))
        return moduli

    @cached_property
    def _at_rest(self) -> Jet:
        return self.strain_energy(Jet(3.0, d1=1.0), Jet(3.0, d2=1.0))

    def _derivatives(self, invariants: IsochoricInvariants) -> Jet:
        # A law of I1 alone does not need I2.
        second = np.nan if self._at_rest.d2 is None else invariants.second
        return self.strain_energy(Jet(invariants.first, d1=1.0), Jet(second, d2=1.0))


def _combination(w1: Any, w2: Any, invariants: IsochoricInvariants) -> np.ndarray:
    """w1 dI1/dF + w2 dI2/dF, (..., 3, 3); weights (...), ``None`` for zero."""
    total = np.zeros_like(invariants.gradient)
    if w1 is not None:
        total += np.asarray(w1)[..., None, None] * invariants.first_derivative
    if w2 is not None:
        total += np.asarray(w2)[..., None, None] * invariants.second_derivative
    return total


@dataclass(frozen=True)
class NeoHookean(Material):
    """W = mu/2 (I1 - 3) with mu = E / (2 (1 + nu)), from a network of Gaussian chains.

    (L. R. G. Treloar, The Physics of Rubber Elasticity, 3rd ed., 1975, chapter 4; isochoric form: Holzapfel 2000,
    section 6.5.)

    """

    youngs_modulus: float = number(4.16, "MPa", "Young's modulus at small strain.", above=0, common=(0.005, 100))
    poisson_ratio: float = _POISSON_RATIO

    def strain_energy(self, i1: Any, i2: Any) -> Any:
        return self.youngs_modulus / (4 * (1 + self.poisson_ratio)) * (i1 - 3)


@dataclass(frozen=True)
class MooneyRivlin(Material):
    """W = c10 (I1 - 3) + c01 (I2 - 3).

    (M. Mooney, J. Appl. Phys. 11, 582, 1940; R. S. Rivlin, Phil. Trans. R. Soc. A 241, 379, 1948.) Neither constant
    may be negative: the energy would be unbounded below, in uniaxial tension for c10 and in equibiaxial tension for
    c01. Fits to uniaxial tests alone often give such a c01; for these, :class:`Yeoh` is safer.

    The shear modulus is mu = 2 (c10 + c01), and must not be 0.
    """

    c10: float = number(REQUIRED, "MPa", "Constant of I1.", minimum=0, common=_COMMON, hint=_FALLS.format("uniaxial"))
    c01: float = number(REQUIRED, "MPa", "Constant of I2.", minimum=0, hint=_FALLS.format("equibiaxial"))
    poisson_ratio: float = _POISSON_RATIO

    def strain_energy(self, i1: Any, i2: Any) -> Any:
        return self.c10 * (i1 - 3) + self.c01 * (i2 - 3)


@dataclass(frozen=True)
class Yeoh(Material):
    """W = c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3.

    (O. H. Yeoh, Rubber Chem. Technol. 66, 754, 1993.) The energy must rise with I1 at any strain, that is,
    c10 + 2 c20 x + 3 c30 x^2 > 0 for all x >= 0; a slightly negative measured c20 is allowed if c30 compensates for
    it.

    The shear modulus is mu = 2 c10.
    """

    c10: float = number(REQUIRED, "MPa", "Constant of I1.", above=0, common=_COMMON)
    c20: float = number(0.0, "MPa", "Constant of (I1 - 3)^2: 0 or more, or above -sqrt(3 c10 c30).")
    c30: float = number(
        0.0, "MPa", "Constant of (I1 - 3)^3.", minimum=0, hint=", below it the energy falls at large strain"
    )
    poisson_ratio: float = _POISSON_RATIO

    def strain_energy(self, i1: Any, i2: Any) -> Any:
        return self.c10 * (i1 - 3) + self.c20 * (i1 - 3) ** 2 + self.c30 * (i1 - 3) ** 3

    def _check(self) -> None:
        least = math.sqrt(3 * self.c10 * self.c30)
        rises = f"0 or more, or above -sqrt(3 c10 c30) = {-least:.4g}, is needed for an energy that rises with strain"
        self._require("c20", self.c20 >= 0 or self.c20 > -least, rises)
