"""The largest strain of a deformed pad, as one number that does not depend on the element size.

At a glued rim and in sharp corners the strain is singular, so that its maximum grows without limit as elements shrink.
Its mean over the most strained fraction of the volume is the integral of an integrable singularity, which converges
(the superquantile, or conditional value at risk: R. T. Rockafellar and S. Uryasev, Journal of Risk 2, 2000).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.elements.nodal_forces import MOST_KEPT, elements_of

SHARE = 0.01
"""Fraction of the volume of the undeformed silicone over which the largest strains are averaged."""
BLOCK = MOST_KEPT
"""Number of elements that are evaluated together. Smaller meshes are one block, which is cached."""


class LargestStrain:
    """The largest principal strain (stretch - 1) of a pad: its mean over that fraction :data:`SHARE` of the volume
    where it is largest.

    Parameters
    ----------
    state : State
        The deformed pad.

    Attributes
    ----------
    value : float
        The strain; 0 at rest.
    """

    def __init__(self, state: State) -> None:
        self._mesh, self._material = state.mesh, state.material
        squares, weights = [], []
        for elements in self._blocks():
            gradient = elements.gradient(slice(None), state.displacement) + np.eye(3)
            squares.append(_largest_eigenvalue(np.swapaxes(gradient, -1, -2) @ gradient))
            weights.append(elements.weight)
        largest, self._weights = np.concatenate(squares), np.concatenate(weights)
        order = np.argsort(-largest, axis=None, kind="stable")
        weight = self._weights.ravel()[order]
        self._volume = float(weight.sum())
        needed = SHARE * self._volume - (np.cumsum(weight) - weight)
        count = int(np.count_nonzero(needed > 0))
        self._weight = np.minimum(weight, needed)[:count]
        self._element, self._point = np.unravel_index(order[:count], largest.shape)
        self._moved = self._at_points(state.displacement)
        gradient = self._moved + np.eye(3)
        values, axes = np.linalg.eigh(np.swapaxes(gradient, -1, -2) @ gradient)
        self._strain, self._axis = np.sqrt(values[:, -1]) - 1, axes[..., -1]
        self.value = float(self._weight @ self._strain) / (SHARE * self._volume)

    def rate(self, displacement: np.ndarray, velocity: np.ndarray) -> float:
        """Derivative of the largest strain with respect to a parameter.

        The averaged volume changes too. By the envelope theorem, the change of its threshold, the least averaged
        strain, does not contribute.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Derivative of the displacement of the N nodes with respect to the parameter, mm per unit.
        velocity : (N, 3) ndarray
            Derivative of the positions of the undeformed nodes with respect to the parameter, mm per unit.

        Returns
        -------
        float
            Derivative of the strain per unit of the parameter.
        """
        dilatation = np.zeros_like(self._weights)
        if velocity.any():
            gradients = (elements.gradient(slice(None), velocity) for elements in self._blocks())
            dilatation = np.concatenate([np.trace(gradient, axis1=-2, axis2=-1) for gradient in gradients])
        mean_dilatation = float((self._weights * dilatation).sum()) / self._volume
        change, velocity_gradient = (self._at_points(field) for field in (displacement, velocity))
        deformed_axis = ((np.eye(3) + self._moved) @ self._axis[:, :, None])[..., 0] / (1 + self._strain)[:, None]
        rates = np.einsum("pi,pij,pj->p", deformed_axis, change - self._moved @ velocity_gradient, self._axis)
        above = self._strain - self._strain[-1]
        sum_of_rates = self._weight @ (rates + dilatation[self._element, self._point] * above) / (SHARE * self._volume)
        return float(sum_of_rates - mean_dilatation * (self.value - self._strain[-1]))

    def _at_points(self, field: np.ndarray) -> np.ndarray:
        """Gradient (K, 3, 3) of a vector field (N, 3) at the K quadrature points over which the largest strain is
        averaged."""
        elements, index = self._averaged
        return elements.gradient(slice(None), field)[index, self._point]

    @cached_property
    def _averaged(self) -> tuple[Elements, np.ndarray]:
        """The elements that contain averaged quadrature points, and for each of the K points the element (K,) among
        them.
        """
        used, index = np.unique(self._element, return_inverse=True)
        return Elements(replace(self._mesh, tets=self._mesh.tets[used]), self._material), index

    def _blocks(self) -> Iterator[Elements]:
        """The elements of the mesh in blocks, one block at a time, because all elements of a large pad would not fit
        into memory.
        """
        count = len(self._mesh.tets)
        if count <= BLOCK:
            yield elements_of(self._mesh, self._material)
            return
        for first in range(0, count, BLOCK):
            yield Elements(replace(self._mesh, tets=self._mesh.tets[first : first + BLOCK]), self._material)


def _largest_eigenvalue(matrices: np.ndarray) -> np.ndarray:
    """Largest eigenvalues (...) of symmetric matrices (..., 3, 3), in closed form (O. K. Smith, Comm. ACM 4, 1961)."""
    mean = np.trace(matrices, axis1=-2, axis2=-1) / 3
    deviator = matrices - mean[..., None, None] * np.eye(3)
    spread = np.sqrt((deviator**2).sum(axis=(-1, -2)) / 6)
    cosine = np.linalg.det(deviator / np.maximum(spread, np.finfo(float).tiny)[..., None, None]) / 2
    return mean + 2 * spread * np.cos(np.arccos(np.clip(cosine, -1, 1)) / 3)


largest_strain = kept(1)(LargestStrain)  # a reading and its derivatives need the same state
