"""The largest strain of a deformed pad, as one number that smaller elements do not change.

At a glued rim and in sharp corners the strain is singular, so that its maximum grows without limit as elements shrink.
Its mean over the most strained share of the volume is the integral of an integrable singularity, which converges (the
superquantile, or conditional value at risk: R. T. Rockafellar and S. Uryasev, Journal of Risk 2, 2000).
"""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.elements.elements import Elements

SHARE = 0.01
"""Share of the volume of the undeformed silicone over which the largest strains are averaged."""
_elements = kept(1)(Elements)  # the states of a study follow each other on one mesh


class LargestStrain:
    """The largest principal strain, stretch - 1, of a state: its mean over the :data:`SHARE` where it is highest.

    Attributes
    ----------
    value : float
        The strain; 0 at rest.
    """

    def __init__(self, state: State) -> None:
        self._elements = _elements(state.mesh, state.material)
        every = self._elements.gradient(slice(None), state.displacement)
        gradient = every + np.eye(3)
        squared = np.swapaxes(gradient, -1, -2) @ gradient
        order = np.argsort(-_largest_eigenvalue(squared), axis=None, kind="stable")
        weight = self._elements.weight.ravel()[order]
        self._volume = float(weight.sum())
        left = SHARE * self._volume - (np.cumsum(weight) - weight)
        last = int(np.count_nonzero(left > 0))
        self._weight = np.minimum(weight, left)[:last]
        self._element, self._point = at = np.unravel_index(order[:last], squared.shape[:2])
        values, axes = np.linalg.eigh(squared[at])
        self._strain, self._moved, self._axis = np.sqrt(values[:, -1]) - 1, every[at], axes[..., -1]
        self.value = float(self._weight @ self._strain) / (SHARE * self._volume)

    def rate(self, displacement: np.ndarray, velocity: np.ndarray) -> float:
        """Its derivative while the displacement changes at a rate (N, 3) and the undeformed nodes move at a velocity
        (N, 3).

        The volume that counts changes too; the envelope theorem leaves its threshold, the last strain, out.
        """
        growth = np.zeros_like(self._elements.weight)
        if velocity.any():
            growth = np.trace(self._elements.gradient(slice(None), velocity), axis1=-2, axis2=-1)
        total = float((self._elements.weight * growth).sum()) / self._volume
        change, spread = (self._at_points(field) for field in (displacement, velocity))
        along = ((np.eye(3) + self._moved) @ self._axis[:, :, None])[..., 0] / (1 + self._strain)[:, None]
        rates = np.einsum("pi,pij,pj->p", along, change - self._moved @ spread, self._axis)
        above = self._strain - self._strain[-1]
        counted = self._weight @ (rates + growth[self._element, self._point] * above) / (SHARE * self._volume)
        return float(counted - total * (self.value - self._strain[-1]))

    def _at_points(self, field: np.ndarray) -> np.ndarray:
        """(K, 3, 3) gradient of a field (N, 3) at the points that count."""
        elements, which = np.unique(self._element, return_inverse=True)
        return self._elements.gradient(elements, field)[which, self._point]


def _largest_eigenvalue(matrices: np.ndarray) -> np.ndarray:
    """(...) largest eigenvalues of symmetric matrices (..., 3, 3), in closed form (O. K. Smith, Comm. ACM 4, 1961)."""
    mean = np.trace(matrices, axis1=-2, axis2=-1) / 3
    rest = matrices - mean[..., None, None] * np.eye(3)
    spread = np.sqrt((rest**2).sum(axis=(-1, -2)) / 6)
    cosine = np.linalg.det(rest / np.maximum(spread, np.finfo(float).tiny)[..., None, None]) / 2
    return mean + 2 * spread * np.cos(np.arccos(np.clip(cosine, -1, 1)) / 3)


largest_strain = kept(1)(LargestStrain)  # a reading and its derivatives ask for that of one state
