"""Strain energies of rubber-like solids, split for the mixed formulation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real

import numpy as np

from mitsuba_taxel.errors import InputError


@dataclass(frozen=True)
class NeoHookean:
    """W = mu/2 (I1 J^(-2/3) - 3) + kappa/2 (J - 1)^2, with mu = E / (2 (1 + nu)) and kappa = E / (3 (1 - 2 nu)).

    The volumetric part enters through a pressure field p with 1/kappa, so that nu = 0.5 (1/kappa = 0) is exact.

    Parameters
    ----------
    youngs_modulus : E at small strain, in MPa
    poisson_ratio : nu, from 0 to 0.5
    """

    youngs_modulus: float = 4.16
    poisson_ratio: float = 0.49

    def __post_init__(self) -> None:
        if not (isinstance(self.youngs_modulus, Real) and 0 < self.youngs_modulus < math.inf):
            raise InputError(
                f"youngs_modulus = {self.youngs_modulus} is not allowed: a finite number above 0 is needed."
            )
        if not (isinstance(self.poisson_ratio, Real) and 0 <= self.poisson_ratio <= 0.5):
            raise InputError(f"poisson_ratio = {self.poisson_ratio} is not allowed: a number from 0 to 0.5 is needed.")

    @property
    def shear_modulus(self) -> float:
        """mu in MPa."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))

    @property
    def compressibility(self) -> float:
        """1 / kappa in 1/MPa; 0 if incompressible."""
        return 3 * (1 - 2 * self.poisson_ratio) / self.youngs_modulus

    def energy(self, gradient: np.ndarray) -> np.ndarray:
        """Isochoric energy density [MPa] for deformation gradients (..., 3, 3)."""
        determinant = np.linalg.det(gradient)
        first_invariant = np.einsum("...ij,...ij->...", gradient, gradient)
        return 0.5 * self.shear_modulus * (first_invariant * determinant ** (-2 / 3) - 3)

    def stress(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray:
        """First Piola-Kirchhoff stress [MPa] of the isochoric energy: mu J^(-2/3) (F - I1/3 F^-T)."""
        first_invariant = np.einsum("...ij,...ij->...", gradient, gradient)
        scale = self.shear_modulus * determinant ** (-2 / 3)
        return scale[..., None, None] * (gradient - first_invariant[..., None, None] / 3 * inverse_transpose)

    def tangent(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray:
        """Derivative dP_ij/dF_kl [MPa], (..., 3, 3, 3, 3), of :meth:`stress`."""
        f, g = gradient, inverse_transpose
        first_invariant = np.einsum("...ij,...ij->...", f, f)[..., None, None, None, None]
        scale = (self.shear_modulus * determinant ** (-2 / 3))[..., None, None, None, None]
        gf = g[..., :, :, None, None] * f[..., None, None, :, :]
        fg = f[..., :, :, None, None] * g[..., None, None, :, :]
        gg = g[..., :, :, None, None] * g[..., None, None, :, :]
        crossed = np.swapaxes(gg, -3, -1)  # G_il G_kj
        identity = np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3))
        return scale * (identity - 2 / 3 * (gf + fg) + first_invariant * (2 / 9 * gg + 1 / 3 * crossed))
