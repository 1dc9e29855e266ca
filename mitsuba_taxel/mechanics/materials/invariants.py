"""Isochoric strain invariants and their derivatives with respect to the deformation gradient."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from mitsuba_taxel.mechanics.materials.moduli import Moduli


class IsochoricInvariants:
    """The isochoric strain invariants I1 J^(-2/3) and I2 J^(-4/3) of deformation gradients, computed when first needed.

    With G = F^-T and H = dI2/dF / 2 = I1 F - F F^T F (G. A. Holzapfel, Nonlinear Solid Mechanics, 2000, sections 6.2
    and 6.4, here by F)::

        d(I1 J^(-2/3))/dF = 2 J^(-2/3) (F - I1/3 G),    d(I2 J^(-4/3))/dF = 2 J^(-4/3) (H - 2 I2/3 G)

    Parameters
    ----------
    gradient : ndarray
        Deformation gradients F (..., 3, 3).
    determinant : ndarray
        Their determinants J (...), above 0.
    inverse_transpose : ndarray
        Their inverse transposes G (..., 3, 3).
    """

    def __init__(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> None:
        self.gradient, self.inverse_transpose = gradient, inverse_transpose
        self._unstretched = determinant ** (-2 / 3)

    @cached_property
    def first(self) -> np.ndarray:
        """First isochoric invariant I1 J^(-2/3), an array (...): 3 without distortion, else larger."""
        return self._unstretched * self._i1

    @cached_property
    def second(self) -> np.ndarray:
        """Second isochoric invariant I2 J^(-4/3), an array (...): 3 without distortion, else larger."""
        return self._unstretched**2 * self._i2

    @cached_property
    def first_derivative(self) -> np.ndarray:
        """Derivative d(I1 J^(-2/3))/dF of the first invariant, (..., 3, 3)."""
        deviator = self.gradient - _tensor(self._i1 / 3) * self.inverse_transpose
        return _tensor(2 * self._unstretched) * deviator

    @cached_property
    def second_derivative(self) -> np.ndarray:
        """Derivative d(I2 J^(-4/3))/dF of the second invariant, (..., 3, 3)."""
        deviator = self._h - _tensor(2 / 3 * self._i2) * self.inverse_transpose
        return _tensor(2 * self._unstretched**2) * deviator

    def curvature(self, w1: Any, w2: Any, pull: Any) -> Moduli:
        """Weighted sum of second derivatives with respect to F: of both invariants and of the volume ratio J, w1 d2(I1
        J^(-2/3))/dF2 + w2 d2(I2 J^(-4/3))/dF2 + p d2J/dF2.

        All dyads with G are summed as G V + V G with one tensor V.

        Parameters
        ----------
        w1, w2 : Any
            Weights (...) in MPa, ``None`` for zero.
        pull : Any
            Mean stress times volume ratio, p J (...), in MPa.

        Returns
        -------
        Moduli
            Second derivatives in MPa.
        """
        f, g = self.gradient, self.inverse_transpose
        with_g = _tensor(0.5 * pull) * g
        crossed, s1, s2 = -pull, np.zeros_like(self._i1), None
        if w1 is not None:
            s1 = 2 * w1 * self._unstretched
            with_g -= _tensor(2 / 3 * s1) * (f - _tensor(self._i1 / 6) * g)
            crossed = crossed + s1 * self._i1 / 3
        if w2 is not None:
            s2 = 2 * w2 * self._unstretched**2
            with_g -= _tensor(4 / 3 * s2) * (self._h - _tensor(self._i2 / 3) * g)
            crossed = crossed + 2 / 3 * s2 * self._i2
        if s2 is None:
            return Moduli([(g, with_g)], [(crossed, g)], s1)
        inner = _tensor(s1 + s2 * self._i1) * np.eye(3) - _tensor(s2) * self._c
        return Moduli([(g, with_g), (f, _tensor(s2) * f)], [(crossed, g), (-s2, f)], inner, -_tensor(s2) * self._b)

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


def _tensor(scalar: np.ndarray) -> np.ndarray:
    return np.asarray(scalar)[..., None, None]
