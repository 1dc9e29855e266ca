"""Strain energies of rubber-like solids, split for the mixed formulation.

A law is a strain energy W(I1, I2) of the isochoric invariants; stress, tangent and small-strain moduli are derived from
it. The volumetric energy kappa/2 (J - 1)^2 is treated separately, by a pressure field p and 1/kappa, so that an
incompressible solid (nu = 0.5, 1/kappa = 0) is exact. A new law is a frozen dataclass with its energy::

    @dataclass(frozen=True)
    class Gent(Material, name="gent"):
        stiffness: float = number(REQUIRED, "MPa", "Shear modulus.", above=0)
        locking: float = number(30.0, "", "Value of I1 - 3 that it does not reach.", above=0)
        poisson_ratio: float = POISSON_RATIO

        def strain_energy(self, i1, i2):
            return -self.stiffness * self.locking / 2 * np.log(1 - (i1 - 3) / self.locking)

By its name it is a material of scenes, and its numbers are parameters of `deformable_pad`. Load paths also accept laws
without a name, and constants without a range. No field may be named ``shear_modulus`` or ``compressibility``, which are
derived.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import is_number
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.fitted import Fitted
from mitsuba_taxel.base.kinds import Kind
from mitsuba_taxel.mechanics.materials.invariants import IsochoricInvariants
from mitsuba_taxel.mechanics.materials.jets import Jet
from mitsuba_taxel.mechanics.materials.moduli import Moduli
from mitsuba_taxel.parameters import REQUIRED, Checked, Number, Parameter, check, number, parameters_of

POISSON_RATIO: Any = number(0.49, "", "Poisson's ratio; 0.5 is incompressible.", minimum=0, maximum=0.5)
COMMON = (0.0005, 20)
"""Usual range of the constants of silicones in MPa; values outside it give a warning."""


class Material(Kind, Checked, Displayed, Fitted, family="material"):
    """A rubber-like solid. Each law is a frozen dataclass whose fields are numbers, ``poisson_ratio`` among them.

    Raises
    ------
    InputError
        if a field is not a finite number, Poisson's ratio is not from 0 to 0.5, or the shear modulus is not above 0.
    """

    meaning = "a law"
    poisson_ratio: float

    @classmethod
    def own_parameters(cls) -> Mapping[str, Parameter]:
        """The constants of a law except Poisson's ratio. A constant without a stated range may be any finite number.

        Returns
        -------
        Mapping[str, Parameter]
            Parameters by name, in the order of the fields.
        """
        declared = parameters_of(cls)
        law: Any = cls
        plain = {
            field.name: Number(
                name=field.name,
                doc=f"Constant of {cls.__name__}.",
                default=REQUIRED if field.default is MISSING else field.default,
            )
            for field in fields(law)
        }
        return {name: declared.get(name, parameter) for name, parameter in plain.items() if name != "poisson_ratio"}

    @classmethod
    def fit(cls, uniaxial: Sequence[str | Path] = (), **tests: Any) -> Any:
        """Fit laws to tests of a silicone: ``Material.fit(...)`` fits and ranks all laws, ``Yeoh.fit(...)`` that law
        alone.

        Parameters
        ----------
        uniaxial : sequence of str or Path
            Tables of uniaxial tests; compression is negative.
        **tests : Any
            Other tests and settings, as for `fit_material`: ``compression``, ``planar``, ``equibiaxial``,
            ``relaxation``, ``area``, ``length``, ``true_stress``, ``up_to``.

        Returns
        -------
        MaterialFit
            Laws with their constants, intervals and errors; ``best.material`` is the law that ranks first.

        Raises
        ------
        InputError
            if a table is refused, tests contradict each other, or the law cannot be fitted.
        """
        return Fitted.fit_of(cls, uniaxial, **tests)

    @abstractmethod
    def strain_energy(self, i1: Any, i2: Any) -> Any:
        """Isochoric strain energy density.

        It may use ``+ - * / **``, ``np.log``, ``np.exp``, ``np.sqrt`` and ``np.square``.

        Parameters
        ----------
        i1, i2 : Any
            Isochoric invariants I1 J^(-2/3) and I2 J^(-4/3), both 3 at rest.

        Returns
        -------
        Any
            Energy density W in MPa, of the same type as the invariants.
        """

    def __post_init__(self) -> None:
        check(self)
        for name in self.parameters:
            self._require(name, True, "a finite number is needed")
        self._require("poisson_ratio", 0 <= self.poisson_ratio <= 0.5, "a number from 0 to 0.5 is needed")
        self._check()

    def _check(self) -> None:
        """Raise `InputError` for an inadmissible material, such as one without shear stiffness. Laws may extend this
        check."""
        self._require("shear_modulus", self.shear_modulus > 0, "a finite number above 0 is needed")

    def _require(self, name: str, condition: bool, needed: str) -> None:
        value = getattr(self, name)
        if not (condition and is_number(value)):
            raise InputError(f"{name} = {value} is not allowed: {needed}.")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the law's constants, each of which :meth:`changed` can change."""
        return tuple(field.name for field in fields(self))  # type: ignore[arg-type]

    def changed(self, **parameters: float) -> Material:
        """Copy of the law with other values of its parameters.

        Parameters
        ----------
        **parameters : float
            New values by name.

        Returns
        -------
        Material
            Material of the same class.

        Raises
        ------
        InputError
            if a value is not allowed.
        TypeError
            if there is no such parameter.
        """
        return replace(self, **parameters)  # type: ignore[type-var]

    @property
    def shear_modulus(self) -> float:
        """Shear modulus at rest in MPa, mu = 2 (dW/dI1 + dW/dI2) (Holzapfel 2000, section 6.5)."""
        rest = self._at_rest
        return 2 * ((rest.d1 or 0.0) + (rest.d2 or 0.0))

    @property
    def youngs_modulus(self) -> float:
        """Young's modulus at small strain in MPa, E = 2 mu (1 + nu)."""
        return 2 * self.shear_modulus * (1 + self.poisson_ratio)

    @property
    def compressibility(self) -> float:
        """Compressibility at small strain in 1/MPa, 1 / kappa = 3 (1 - 2 nu) / E; 0 if incompressible."""
        return 3 * (1 - 2 * self.poisson_ratio) / self.youngs_modulus

    def energy(self, gradient: np.ndarray) -> np.ndarray:
        """Isochoric energy density.

        Parameters
        ----------
        gradient : (..., 3, 3) ndarray
            Deformation gradients F.

        Returns
        -------
        (...) ndarray
            Energy density in MPa.
        """
        inverse_transpose = np.swapaxes(np.linalg.inv(gradient), -1, -2)
        invariants = IsochoricInvariants(gradient, np.linalg.det(gradient), inverse_transpose)
        return self.strain_energy(invariants.first, invariants.second)

    def stress(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray:
        """First Piola-Kirchhoff stress of the isochoric energy, W1 dI1/dF + W2 dI2/dF.

        Parameters
        ----------
        gradient : (..., 3, 3) ndarray
            Deformation gradients F.
        determinant : (...) ndarray
            Determinants of F, above 0.
        inverse_transpose : (..., 3, 3) ndarray
            Inverse transposes F^-T.

        Returns
        -------
        (..., 3, 3) ndarray
            Stress in MPa.
        """
        invariants = IsochoricInvariants(gradient, determinant, inverse_transpose)
        w = self._derivatives(invariants)
        return _combination(w.d1, w.d2, invariants)

    def tangent(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray:
        """Derivative dP_ij/dF_kl of :meth:`stress`.

        Parameters
        ----------
        gradient : (..., 3, 3) ndarray
            Deformation gradients F.
        determinant : (...) ndarray
            Determinants of F, above 0.
        inverse_transpose : (..., 3, 3) ndarray
            Inverse transposes F^-T.

        Returns
        -------
        (..., 3, 3, 3, 3) ndarray
            Derivative in MPa.
        """
        return self.moduli(gradient, determinant, inverse_transpose, np.zeros_like(determinant)).dense()

    def moduli(
        self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray, pressure: np.ndarray
    ) -> Moduli:
        """Derivative of :meth:`stress`, and of the pressure times d(det F)/dF, as a sum of few tensors.

        Parameters
        ----------
        gradient : (..., 3, 3) ndarray
            Deformation gradients F.
        determinant : (...) ndarray
            Determinants of F, above 0.
        inverse_transpose : (..., 3, 3) ndarray
            Inverse transposes F^-T.
        pressure : (...) ndarray
            Pressures in MPa, positive in tension.

        Returns
        -------
        Moduli
            Derivative in MPa.
        """
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
    """Weighted sum w1 dI1/dF + w2 dI2/dF (..., 3, 3) of the derivatives of both invariants, with weights (...); a
    weight ``None`` means zero."""
    total = np.zeros_like(invariants.gradient)
    if w1 is not None:
        total += np.asarray(w1)[..., None, None] * invariants.first_derivative
    if w2 is not None:
        total += np.asarray(w2)[..., None, None] * invariants.second_derivative
    return total
