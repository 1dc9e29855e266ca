"""Response of a phototransistor to light scattered by walls."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.transport.ends import End
from mitsuba_taxel.transport.exchange import Exchange, Starts

WIDER = 10.0
"""Width over which the step at the horizon of a wall is spread, relative to that between walls: the spacing of the
points of a phototransistor as seen from a wall nearby, whose horizon passes whole rows of them at once."""


class Reception:
    """Response to a watt at points (T) of walls."""

    def __init__(self, end: End, starts: Starts) -> None:
        self._end, self._shape = end, (len(starts.at), len(end.points))
        start, point = (each.ravel() for each in np.indices(self._shape))
        self._exchange = Exchange(starts, end.points, end.weights[:, None] * end.normal, start, point)
        self._away = end.points - starts.at[:, None]
        self._distance = np.linalg.norm(self._away, axis=2)
        self._cosine = -(self._away @ end.normal) / self._distance
        self._response, self._slope = (each * (self._cosine > end.law.cutoff) for each in end.law(self._cosine))
        self._bare = self._exchange.values().reshape(self._shape)

    @property
    def value(self) -> np.ndarray:
        """(T,) W per W."""
        return (self._bare * self._response).sum(axis=1)

    def gradient(self, adjoint: np.ndarray, wider: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (T, 3) of ``adjoint`` . :attr:`value` by the positions and by the unit normals of the walls, with
        a horizon that is ``wider`` by a factor."""
        slopes = self._exchange.slopes((adjoint[:, None] * self._response).ravel(), WIDER * wider)
        by_end, by_normal = (
            np.stack([part.reshape(self._shape).sum(axis=1) for part in each], axis=1)
            for each in (slopes.by_end, slopes.by_normal)
        )
        # The cosine is -(away . normal) / distance; its derivatives by position and end have opposite signs.
        turned = adjoint[:, None] * self._bare * self._slope / self._distance
        direction = self._away / self._distance[:, :, None]
        along = np.einsum("te,tec->tc", turned * self._cosine, direction)
        return along + turned.sum(axis=1)[:, None] * self._end.normal - by_end, by_normal
