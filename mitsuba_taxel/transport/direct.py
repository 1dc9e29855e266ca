"""Light that a phototransistor receives directly from lit walls, at the points that a peaked LED lights.

Polynomials on patches interpolate the response of the walls. Where most of an LED's light falls on a part of one patch,
their error does not average out, and neither does that of slopes as the walls move below the peak. Most of it is that
of the direct response, which is known at any point: replaced there, only light via other walls is interpolated.
Source: the iterated solution of Sloan, in K. E. Atkinson, The Numerical Solution of Integral Equations of the Second
Kind, Cambridge University Press, 1997, section 3.4.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mitsuba_taxel.transport.emission import Emission, LitPoints
from mitsuba_taxel.transport.ends import End
from mitsuba_taxel.transport.exchange import Starts
from mitsuba_taxel.transport.reception import Reception


class Direct:
    """What the interpolation of the direct response leaves out of a reading.

    Parameters
    ----------
    emission : Emission
    phototransistor : End
    isotropic, lambertian : (F,) ndarray
        Share of the incident light that each patch scatters with this law.
    known : (T,) ndarray
        Direct response at the points of the patches.
    """

    def __init__(
        self,
        emission: Emission,
        phototransistor: End,
        isotropic: np.ndarray,
        lambertian: np.ndarray,
        known: np.ndarray,
    ) -> None:
        self._emission, self._phototransistor = emission, phototransistor
        self._shares, self._known = (isotropic, lambertian), known
        self._reception = self._received(emission.inside)
        self._left_out = emission.lit * self._missing(emission.inside, self._reception)

    @property
    def value(self) -> float:
        """In W per W of the LED."""
        return float(self._left_out.sum())

    def by_patch(self, count: int) -> np.ndarray:
        """(F,) the same, by the patch that is lit."""
        return np.bincount(self._emission.inside.points.face, self._left_out, count)

    @cached_property
    def missing(self) -> tuple[np.ndarray, np.ndarray]:
        """Direct responses at points lit inside the cone and at its edge, less what is interpolated there."""
        inside, edge = self._emission.inside, self._emission.edge
        at_edge = self._missing(edge, self._received(edge)) if len(edge.source) else np.zeros(0)
        return self._missing(inside, self._reception), at_edge

    def gradient(self, wider: float) -> np.ndarray:
        """(F, 15, 3) derivatives by the patches' positions through the direct response at lit points alone."""
        places, points = self._emission.places, self._emission.inside.points
        by_start, by_normal = self._reception.gradient(self._emission.lit, wider)
        _, area = points.placed(places)
        length = np.linalg.norm(area, axis=1, keepdims=True)
        normal = area / length
        by_area = (by_normal - (by_normal * normal).sum(axis=1, keepdims=True) * normal) / length
        return points.gradient(places, by_start, by_area)

    def _received(self, lit: LitPoints) -> Reception:
        at, area = lit.points.placed(self._emission.places)
        normal = area / np.linalg.norm(area, axis=1, keepdims=True)
        return Reception(self._phototransistor, Starts(at, normal, *(each[lit.points.face] for each in self._shares)))

    def _missing(self, lit: LitPoints, reception: Reception) -> np.ndarray:
        return reception.value - self._emission.at(lit, self._known)
