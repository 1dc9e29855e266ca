"""The isochoric strain invariants and their derivatives by the deformation gradient."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np


class IsochoricInvariants:
    """I1 J^(-2/3) and I2 J^(-4/3) of deformation gradients, each computed when first asked for.

    With G = F^-T and H = dI2/dF / 2 = I1 F - F F^T F (G. A. Holzapfel, Nonlinear Solid Mechanics, 2000, sections 6.2
    and 6.4, here by F)::

        d(I1 J^(-2/3))/dF = 2 J^(-2/3) (F - I1/3 G),    d(I2 J^(-4/3))/dF = 2 J^(-4/3) (H - 2 I2/3 G)

    Parameters
    ----------
    gradient : F (..., 3, 3)
    determinant : J (...), above 0
    inverse_transpose : G (..., 3, 3)
    """

    def __init__(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> None:
        self.gradient, self.inverse_transpose = gradient, inverse_transpose
        self._unstretched = determinant ** (-2 / 3)

    @cached_property
    def first(self) -> np.ndarray:
        """I1 J^(-2/3), (...); 3 where nothing is distorted, more elsewhere."""
        return self._unstretched * self._i1

    @cached_property
    def second(self) -> np.ndarray:
        """I2 J^(-4/3), (...); 3 where nothing is distorted, more elsewhere."""
        return self._unstretched**2 * self._i2

    @cached_property
    def first_derivative(self) -> np.ndarray:
        """d(I1 J^(-2/3))/dF, (..., 3, 3)."""
        deviator = self.gradient - _tensor(self._i1 / 3) * self.inverse_transpose
        return _tensor(2 * self._unstretched) * deviator

    @cached_property
    def second_derivative(self) -> np.ndarray:
        """d(I2 J^(-4/3))/dF, (..., 3, 3)."""
        deviator = self._h - _tensor(2 / 3 * self._i2) * self.inverse_transpose
        return _tensor(2 * self._unstretched**2) * deviator

    def curvature(self, w1: Any, w2: Any) -> np.ndarray:
        """w1 d2(I1 J^(-2/3))/dF2 + w2 d2(I2 J^(-4/3))/dF2, (..., 3, 3, 3, 3); weights (...), ``None`` for zero.

        The two are summed where they are still small: the dyads with G, for one, as G V + V G with one tensor V.
        """
        f, g = self.gradient, self.inverse_transpose
        with_g = np.zeros_like(f)
        crossed = np.zeros_like(self._i1)
        if w1 is not None:
            s1 = 2 * w1 * self._unstretched
            with_g -= _tensor(2 / 3 * s1) * (f - _tensor(self._i1 / 6) * g)
            crossed += s1 * self._i1 / 3
        if w2 is not None:
            s2 = 2 * w2 * self._unstretched**2
            with_g -= _tensor(4 / 3 * s2) * (self._h - _tensor(self._i2 / 3) * g)
            crossed += 2 / 3 * s2 * self._i2
        curvature = dyad(g, with_g)
        curvature += dyad(with_g, g)
        curvature += _crossed(_tensor(crossed) * g, g)
        # The derivatives of F and of H
        if w1 is not None:
            _over_ij(curvature)[...] += _tensor(s1)
        if w2 is not None:
            curvature += dyad(_tensor(2 * s2) * f, f)
            curvature -= _crossed(_tensor(s2) * f, f)
            _over_i(curvature)[...] += (_tensor(s2) * (_tensor(self._i1) * np.eye(3) - self._c))[..., None, :, :]
            _over_j(curvature)[...] -= (_tensor(s2) * self._b)[..., :, None, :]
        return curvature

    @cached_property
    def _i1(self) -> np.ndarray:
        return np.einsum("...ij,...ij->...", self.gradient, self.gradient)

    @cached_property
    def _i2(self) -> np.ndarray:
        return 0.5 * (self._i1**2 - np.einsum("...ij,...ij->...", self._c, self._c))

    @cached_property
    def _b(self) -> np.ndarray:
        return self.gradient @ np.swapaxes(self.gradient, -1, -2)

    @cached_property
    def _c(self) -> np.ndarray:
        return np.swapaxes(self.gradient, -1, -2) @ self.gradient

    @cached_property
    def _h(self) -> np.ndarray:
        return _tensor(self._i1) * self.gradient - self.gradient @ self._c


def dyad(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """L_ij R_kl, (..., 3, 3, 3, 3)."""
    return left[..., :, :, None, None] * right[..., None, None, :, :]


def _crossed(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """L_il R_kj, (..., 3, 3, 3, 3)."""
    return left[..., :, None, None, :] * np.swapaxes(right, -1, -2)[..., None, :, :, None]


def _tensor(scalar: np.ndarray) -> np.ndarray:
    return np.asarray(scalar)[..., None, None]


# Writable views of the entries in which indices agree: delta_ik delta_jl, delta_ik and delta_jl.


def _over_ij(moduli: np.ndarray) -> np.ndarray:
    return np.einsum("...ijij->...ij", moduli)


def _over_i(moduli: np.ndarray) -> np.ndarray:
    return np.einsum("...ijil->...ijl", moduli)


def _over_j(moduli: np.ndarray) -> np.ndarray:
    return np.einsum("...ijkj->...ijk", moduli)
