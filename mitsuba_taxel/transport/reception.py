"""What a phototransistor makes of light that walls scatter towards it."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.transport.ends import End
from mitsuba_taxel.transport.exchange import exchange


class Reception:
    """What it makes of a watt at points (T, 3) of walls with such normals and shares."""

    def __init__(self, end: End, at: np.ndarray, normal: np.ndarray, isotropic: np.ndarray, lambertian: np.ndarray):
        self._end = end
        starts, normals = (each.T[:, :, None] for each in (at, normal))
        ends, areas = (each.T[:, None] for each in (end.points, end.weights[:, None] * end.normal))
        self._away = ends - starts
        arguments = starts, normals, ends, areas, isotropic[:, None], lambertian[:, None]
        self._bare = exchange(*arguments, True)
        self._distance = np.sqrt((self._away**2).sum(axis=0))
        self._cosine = -np.einsum("cij,c->ij", self._away, end.normal) / self._distance
        self._response, self._slope = (each * (self._cosine > end.law.cutoff) for each in end.law(self._cosine))

    @property
    def value(self) -> np.ndarray:
        """(T,) W per W."""
        return (self._bare.value * self._response).sum(axis=1)

    def gradient(self, adjoint: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(T, 3) each: derivatives of ``adjoint`` . :attr:`value` by the places and unit normals of the walls."""
        given, bare, end = adjoint[:, None] * self._response, self._bare, self._end
        turned = adjoint[:, None] * bare.value * self._slope
        # The cosine is -(away . normal) / distance, and falls with the place as it rises with the end.
        of_start = (end.normal[:, None, None] + self._cosine * self._away / self._distance) / self._distance
        by_start = given * bare.by_start + turned * of_start
        return by_start.sum(axis=2).T, (given * bare.by_normal).sum(axis=2).T
