"""The least distance between the cells of a pad and the packages in them, and its derivatives."""

from __future__ import annotations

import math

import mitsuba as mi
import numpy as np

from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.triangles import closest_on_triangles
from mitsuba_taxel.mechanics import State
from mitsuba_taxel.pads.pad import REGIONS
from mitsuba_taxel.sensing.clearance import packages
from mitsuba_taxel.sensing.linearised_pad import Nodal

WALLS = (REGIONS["roof"], REGIONS["side"])
_PLACES = shape_functions(np.array([[6 - i - j, i, j] for i in range(7) for j in range(7 - i)]) / 6)
"""(28, 6) at the points of a face that are looked at."""


class PackageClearance:
    """The least distance in a state, from points of the walls of cells, of which each face has 28.

    Attributes
    ----------
    value : float
        In mm; NaN if the scene has no packages.
    """

    def __init__(self, state: State, bodies: list[np.ndarray]) -> None:
        self.value = math.nan
        faces = state.mesh.faces[np.isin(state.mesh.face_region, WALLS)]
        places = np.einsum("pk,fki->fpi", _PLACES, (state.mesh.points + state.displacement)[faces]).reshape(-1, 3)
        found = [(*_nearest(places, body), body) for body in bodies] if len(places) else []
        if found:
            self.value, number, self._body = min(found, key=lambda each: each[0])
            self._place, self._nodes = places[number], faces[number // len(_PLACES)]
            self._weights = _PLACES[number % len(_PLACES)]

    def rate(self, nodal: Nodal, others: list[tuple[float, list[np.ndarray]]]) -> float:
        """Its derivative while nodes move, and packages as the differences with ``others``, weights and bodies, say.

        The nearest point of the walls changes too; as it is the nearest, that makes no difference to first order.
        """
        if math.isnan(self.value):
            return math.nan
        foot = _feet(self._place, self._body)[1]
        away = (self._place - foot) / max(self.value, np.finfo(float).tiny)
        moved = self._weights @ (nodal.displacement + nodal.velocity)[self._nodes]
        apart = (weight * min(_feet(self._place, body)[0] for body in bodies) for weight, bodies in others)
        return float(away @ moved) + float(sum(apart))


def clearances(
    state: State, nodal: list[Nodal], scene: mi.Scene, others: list[list[tuple[float, mi.Scene]]]
) -> tuple[float, np.ndarray]:
    """The clearance of the pad of a scene, and its rates (P,) with movements of its nodes and of other parts."""
    found = PackageClearance(state, packages(scene))
    moved = [[(weight, packages(live)) for weight, live in each] for each in others]
    return found.value, np.array([found.rate(*each) for each in zip(nodal, moved, strict=True)])


def _nearest(places: np.ndarray, body: np.ndarray) -> tuple[float, int]:
    """Distance of the nearest of points (N, 3) from a body (K, 3, 3), and its number.

    Only those are looked at whose distance from the box around the body is below the least that is known.
    """
    low, high = body.min(axis=(0, 1)), body.max(axis=(0, 1))
    lower = np.linalg.norm(np.maximum(np.maximum(low - places, places - high), 0), axis=1)
    best = int(lower.argmin())
    least = _feet(places[best], body)[0]
    for number in np.flatnonzero(lower < least - 1e-9):
        distance = _feet(places[number], body)[0]
        if distance < least:
            best, least = int(number), distance
    return least, best


def _feet(place: np.ndarray, body: np.ndarray) -> tuple[float, np.ndarray]:
    """Distance of a point (3,) from a body (K, 3, 3), and its nearest point (3,) there."""
    feet = closest_on_triangles(np.broadcast_to(place, (len(body), 3)), body)
    distances = np.linalg.norm(feet - place, axis=1)
    nearest = int(distances.argmin())
    return float(distances[nearest]), feet[nearest]
