"""Ogden's material law, a function of the principal stretches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.mechanics.materials.drucker import require_stable
from mitsuba_taxel.mechanics.materials.invariants import IsochoricInvariants
from mitsuba_taxel.mechanics.materials.laws.material import COMMON, POISSON_RATIO, Material
from mitsuba_taxel.mechanics.materials.moduli import Moduli
from mitsuba_taxel.mechanics.materials.principal_stretches import PLANES, PrincipalStretches
from mitsuba_taxel.parameters import REQUIRED, number

TERMS = (1, 2, 3)


@dataclass(frozen=True)
class Ogden(Material, name="ogden", rank=5):
    """W = sum of 2 mu_i / alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3) with one to three terms.

    Strain energy W of Ogden's law; the l are the isochoric principal stretches. (R. W. Ogden, Proc. R. Soc. A 326, 565,
    1972, with the constants of Abaqus and CalculiX.) Constants of the form mu_i' / alpha_i (l1^alpha_i + ...), as in
    Ogden's paper, COMSOL and Ansys, are converted by mu_i = mu_i' alpha_i / 2. One term with alpha = 2 is
    :class:`NeoHookean`; two terms with alpha 2 and -2 are :class:`MooneyRivlin`.

    Negative mu_i are allowed if stress rises with strain in all modes up to a principal stretch of 1.5.

    The shear modulus is mu = mu_1 + mu_2 + mu_3.
    """

    mu_1: float = number(REQUIRED, "MPa", "Shear modulus of the first term.", common=COMMON)
    alpha_1: float = number(REQUIRED, "", "Exponent of the first term, not 0.", minimum=-50, maximum=50)
    mu_2: float = number(0.0, "MPa", "Shear modulus of the second term.")
    alpha_2: float = number(-2.0, "", "Exponent of the second term, not 0.", minimum=-50, maximum=50)
    mu_3: float = number(0.0, "MPa", "Shear modulus of the third term.")
    alpha_3: float = number(4.0, "", "Exponent of the third term, not 0.", minimum=-50, maximum=50)
    poisson_ratio: float = POISSON_RATIO

    def strain_energy(self, i1: Any, i2: Any) -> Any:
        # Squared stretches are the zeros of x^3 - i1 x^2 + i2 x - 1, by Viete's formula.
        centre = np.asarray(i1) / 3
        spread = np.sqrt(np.maximum(centre**2 - np.asarray(i2) / 3, 0))
        half_value = centre**3 - 0.5 * centre * i2 + 0.5
        cosine = np.clip(half_value / np.maximum(spread, 1e-100) ** 3, -1, 1)
        angles = (np.arccos(cosine)[..., None] + 2 * np.pi * np.arange(3)) / 3
        return self._energy(0.5 * np.log(centre[..., None] + 2 * spread[..., None] * np.cos(angles)))

    @property
    def terms(self) -> list[tuple[float, float]]:
        """Shear modulus mu_i in MPa and exponent alpha_i of each term whose modulus is not 0."""
        every = [(getattr(self, f"mu_{i}"), getattr(self, f"alpha_{i}")) for i in TERMS]
        return [(modulus, exponent) for modulus, exponent in every if modulus]

    @property
    def shear_modulus(self) -> float:
        return self.mu_1 + self.mu_2 + self.mu_3

    def energy(self, gradient: np.ndarray) -> np.ndarray:
        return self._energy(PrincipalStretches(gradient).isochoric_logarithms)

    def stress(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray:
        stretches = PrincipalStretches(gradient)
        kirchhoff = self._stress_and_slope(stretches.isochoric_logarithms)[0]
        return np.einsum("...a,...aij->...ij", kirchhoff / stretches.squared, stretches.dyads)

    def moduli(
        self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray, pressure: np.ndarray
    ) -> Moduli:
        # With the second Piola-Kirchhoff stresses S_a = t_a / l_a^2, the derivative is delta_ik S_jl, and dyads of
        # l_a n_a N_a and of l_a n_a N_b + l_b n_b N_a (G. A. Holzapfel, Nonlinear Solid Mechanics, 2000, section 6.6).
        # The quotients (t_a - t_b) / (l_a^2 - l_b^2) are those of hyperbolic sines, which need no limit at equal
        # stretches.
        stretches = PrincipalStretches(gradient)
        logarithms, squared = stretches.isochoric_logarithms, stretches.squared
        kirchhoff, slope = self._stress_and_slope(logarithms)
        second = kirchhoff / squared

        # Normal components: changes of t_a by logarithmic strains, with the trace taken out.
        normal = slope[..., None] * np.eye(3) - (slope[..., :, None] + slope[..., None, :]) / 3
        normal = normal + slope.sum(axis=-1)[..., None, None] / 9 - 2 * kirchhoff[..., None] * np.eye(3)
        normal = normal / (squared[..., :, None] * squared[..., None, :])
        towards = np.einsum("...ab,...bij->...aij", 0.5 * normal, stretches.dyads)
        pairs = [(stretches.dyads[..., a, :, :], towards[..., a, :, :]) for a in range(3)]

        # Shear components.
        for (a, b), shear in zip(PLANES, stretches.shears(), strict=True):
            quotient = self._quotient(logarithms[..., a], logarithms[..., b])
            quotient = quotient / np.sqrt(squared[..., a] * squared[..., b])
            weight = 0.5 * (quotient - second[..., b]) / squared[..., a]
            pairs.append((shear, weight[..., None, None] * shear))

        moduli = IsochoricInvariants(gradient, determinant, inverse_transpose).curvature(
            None, None, pressure * determinant
        )
        moduli.pairs.extend(pairs)
        return moduli.with_inner(stretches.material_tensor(second))

    def _check(self) -> None:
        for i in TERMS:
            self._require(f"alpha_{i}", getattr(self, f"alpha_{i}") != 0, "an exponent other than 0 is needed")
        for i in TERMS:
            if getattr(self, f"mu_{i}") < 0:
                require_stable(self, f"mu_{i}")
        super()._check()

    def _energy(self, logarithms: np.ndarray) -> np.ndarray:
        """Energy densities (...) in MPa at isochoric logarithmic strains (..., 3)."""
        return np.asarray(
            sum(2 * mu / alpha**2 * np.expm1(alpha * logarithms).sum(axis=-1) for mu, alpha in self.terms)
        )

    def _stress_and_slope(self, logarithms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Principal deviatoric Kirchhoff stresses t_a (..., 3) in MPa at isochoric logarithmic strains (..., 3), and
        the derivatives (..., 3) of l w'(l) with respect to ln l."""
        value, slope = np.zeros_like(logarithms), np.zeros_like(logarithms)
        for mu, alpha in self.terms:
            value += 2 * mu / alpha * np.expm1(alpha * logarithms)
            slope += 2 * mu * np.exp(alpha * logarithms)
        return value - value.mean(axis=-1, keepdims=True), slope

    def _quotient(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Shear modulus between two principal directions, (t_a - t_b) / (l_a / l_b - l_b / l_a), from the isochoric
        logarithms of both stretches."""
        difference = first - second
        equal = np.abs(difference) < 1e-150
        difference = np.where(equal, 1.0, difference)
        total: np.ndarray = np.zeros_like(difference)
        for mu, alpha in self.terms:
            ratio = np.where(equal, alpha / 2, np.sinh(alpha / 2 * difference) / np.sinh(difference))
            total = total + 2 * mu / alpha * np.exp(alpha / 2 * (first + second)) * ratio
        return total
