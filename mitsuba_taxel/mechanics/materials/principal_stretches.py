"""Principal stretches of deformation gradients, and moduli of energies that are sums over them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

PLANES = ((0, 1), (0, 2), (1, 2))
"""Pairs of principal directions."""


class PrincipalStretches:
    """Principal stretches and directions of deformation gradients F = sum of l_a n_a N_a.

    Parameters
    ----------
    gradient : ndarray
        Deformation gradients F (..., 3, 3) with det F above 0.

    Attributes
    ----------
    squared : (..., 3) ndarray
        Squared stretches l_a^2.
    axes : (..., 3, 3) ndarray
        Undeformed principal directions N_a, in rows.
    """

    def __init__(self, gradient: np.ndarray) -> None:
        self._gradient = gradient
        self.squared, axes = np.linalg.eigh(np.swapaxes(gradient, -1, -2) @ gradient)
        self.axes = np.swapaxes(axes, -1, -2)

    @cached_property
    def isochoric_logarithms(self) -> np.ndarray:
        """Logarithms (..., 3) of the isochoric stretches J^(-1/3) l_a; their sum is 0."""
        logarithms = 0.5 * np.log(self.squared)
        return logarithms - logarithms.mean(axis=-1, keepdims=True)

    @cached_property
    def dyads(self) -> np.ndarray:
        """The terms l_a n_a N_a of the deformation gradient, one for each principal direction a: tensors (..., 3, 3,
        3), with a as the first of the last three indices.
        """
        return self._moved[..., :, :, None] * self.axes[..., :, None, :]

    def shears(self) -> list[np.ndarray]:
        """The tensors of shear between two principal directions, l_a n_a N_b + l_b n_b N_a, (..., 3, 3), for each pair
        of `PLANES`.
        """
        moved, axes = self._moved[..., :, :, None], self.axes[..., :, None, :]
        return [moved[..., a, :, :] * axes[..., b, :, :] + moved[..., b, :, :] * axes[..., a, :, :] for a, b in PLANES]

    def material_tensor(self, values: np.ndarray) -> np.ndarray:
        """The tensor (..., 3, 3) with given values v (..., 3) along the undeformed principal directions: the sum of v_a
        N_a N_a.
        """
        return np.swapaxes(self.axes, -1, -2) @ (values[..., None] * self.axes)

    @cached_property
    def _moved(self) -> np.ndarray:
        """Images F N_a = l_a n_a of the undeformed principal directions N_a: vectors (..., 3, 3), one row for each
        direction a."""
        return self.axes @ np.swapaxes(self._gradient, -1, -2)
