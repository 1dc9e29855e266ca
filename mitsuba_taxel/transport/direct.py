"""Light that a phototransistor receives directly from lit walls.

Polynomials on patches interpolate the response of the walls. Most of an LED's light falls on a few of them, so that
their errors do not average out, and neither do those of slopes as the walls move. Most of it is that of the direct
response, which needs no solution: it is interpolated by polynomials of fourth degree.
"""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.transport.emission import Emission, LitPoints
from mitsuba_taxel.transport.ends import End
from mitsuba_taxel.transport.exchange import Starts
from mitsuba_taxel.transport.patches import DEGREE, LATTICE, PatchPoints
from mitsuba_taxel.transport.reception import Reception
from mitsuba_taxel.transport.rules import monomials

_NODES = 1 / 3 + 0.8 * (LATTICE - 1 / 3)
"""(15, 2) coordinates (s, t) where the response is known: within patches, as it may end at their rim."""
_COEFFICIENTS = np.linalg.inv(monomials(_NODES, DEGREE))
"""(15, 15) from values there to the polynomial through them."""


class Direct:
    """What the coarser interpolation of the direct response leaves out of a reading.

    Parameters
    ----------
    emission : Emission
    phototransistor : End
    isotropic, lambertian : (F,) ndarray
        Share of the incident light that each patch scatters with this law.
    known : (F * Q,) ndarray
        Direct response at the points of the patches, as :class:`Emission` interpolates it.
    """

    def __init__(
        self, emission: Emission, phototransistor: End, isotropic: np.ndarray, lambertian: np.ndarray, known: np.ndarray
    ) -> None:
        self._emission, self._known = emission, known
        count, size = len(emission.places), len(_NODES)
        own = np.repeat(np.arange(count), size)
        self._points = PatchPoints(own, np.tile(_NODES, (count, 1)))
        at, area = self._points.placed(emission.places)
        self._length = np.linalg.norm(area, axis=1, keepdims=True)
        self._normal = area / self._length
        self._reception = Reception(phototransistor, Starts(at, self._normal, isotropic[own], lambertian[own]))
        into = emission.inside.points.face[:, None] * size + np.arange(size)
        lit = emission.lit[:, None] * _shares(emission.inside)
        self._power = np.bincount(into.ravel(), lit.ravel(), len(own))

    @property
    def value(self) -> float:
        """In W per W of the LED."""
        return float(self.by_patch().sum())

    def by_patch(self) -> np.ndarray:
        """(F,) the same, by the patch that is lit."""
        both = self._power * self._reception.value, self._emission.power * self._known
        finer, coarser = (each.reshape(len(self._emission.places), -1).sum(axis=1) for each in both)
        return finer - coarser

    def missing(self, lit: LitPoints) -> np.ndarray:
        """(N,) direct responses at lit points, less those of the coarser interpolation."""
        finer = self._reception.value.reshape(-1, len(_NODES))[lit.points.face]
        return np.einsum("nq,nq->n", _shares(lit), finer) - self._emission.at(lit, self._known)

    def gradient(self, wider: float) -> np.ndarray:
        """(F, 15, 3) derivatives by the patches' positions through the finer direct response alone."""
        by_start, by_normal = self._reception.gradient(self._power, wider)
        across = by_normal - (by_normal * self._normal).sum(axis=1, keepdims=True) * self._normal
        return self._points.gradient(self._emission.places, by_start, across / self._length)


def _shares(lit: LitPoints) -> np.ndarray:
    """(N, 15) weights of the values at nodes for those at lit points."""
    return monomials(lit.points.at, DEGREE) @ _COEFFICIENTS
