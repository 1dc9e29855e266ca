"""The least distance between the cells of a pad and the packages in them, and its derivatives."""

from __future__ import annotations

import math
from collections.abc import Iterator

import mitsuba as mi
import numpy as np

from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.triangles import closest_on_triangles
from mitsuba_taxel.mechanics import State
from mitsuba_taxel.mechanics.contact.bodies import body_of_each
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.sensing.derivatives.linearised_pad import Nodal
from mitsuba_taxel.sensing.scene.clearance import packages

WALLS = (REGIONS["roof"], REGIONS["side"])
_PLACES = shape_functions(np.array([[6 - i - j, i, j] for i in range(7) for j in range(7 - i)]) / 6)
"""(28, 6) at the points of a face that are looked at."""
_AT_ONCE = 32
"""Points whose distance from a body is computed at once."""


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
        least = math.inf
        for body in _each(bodies):
            distance, number = _nearest(places, body, least)
            if distance < least:
                self.value = least = distance
                self._body, self._place, self._nodes = body, places[number], faces[number // len(_PLACES)]
                self._weights = _PLACES[number % len(_PLACES)]

    def rate(self, nodal: Nodal, others: list[tuple[float, list[np.ndarray]]]) -> float:
        """Its derivative while nodes move, and packages as the differences with ``others``, weights and bodies, say.

        The nearest point of the walls changes too; as it is the nearest, that makes no difference to first order.
        """
        if math.isnan(self.value):
            return math.nan
        away = self._way_from(self._body) / max(self.value, np.finfo(float).tiny)
        moved = self._weights @ (nodal.displacement + nodal.velocity)[self._nodes]
        apart = (weight * min(map(self._distance_from, bodies)) for weight, bodies in others)
        return float(away @ moved) + float(sum(apart))

    def _way_from(self, body: np.ndarray) -> np.ndarray:
        return self._place - _feet(self._place[None], body)[0]

    def _distance_from(self, body: np.ndarray) -> float:
        return float(np.linalg.norm(self._way_from(body)))


def clearances(
    state: State, nodal: list[Nodal], scene: mi.Scene, others: list[list[tuple[float, mi.Scene]]]
) -> tuple[float, np.ndarray]:
    """The clearance of the pad of a scene, and its rates (P,) with movements of its nodes and of other parts."""
    found = PackageClearance(state, packages(scene))
    moved = [[(weight, packages(live)) for weight, live in each] for each in others]
    return found.value, np.array([found.rate(*each) for each in zip(nodal, moved, strict=True)])


def _each(bodies: list[np.ndarray]) -> Iterator[np.ndarray]:
    """The packages, of which a body is made."""
    for body in bodies:
        number = body_of_each(body)
        yield from (body[number == k] for k in range(number.max() + 1))


def _nearest(places: np.ndarray, body: np.ndarray, least: float) -> tuple[float, int]:
    """Distance of the nearest of points (N, 3) from a body (K, 3, 3), if less than ``least``, and its number.

    Points are looked at by their distance from the box around the body, up to the least distance that is known.
    """
    low, high = body.min(axis=(0, 1)), body.max(axis=(0, 1))
    lower = np.linalg.norm(np.maximum(np.maximum(low - places, places - high), 0), axis=1)
    first = int(lower.argmin())
    bound = min(least, float(np.linalg.norm(_feet(places[first : first + 1], body) - places[first])))
    near = np.flatnonzero(lower <= bound)
    order, nearest = near[np.argsort(lower[near], kind="stable")], -1
    for start in range(0, len(order), _AT_ONCE):
        some = order[start : start + _AT_ONCE]
        if lower[some[0]] >= least:
            break
        distances = np.linalg.norm(_feet(places[some], body) - places[some], axis=1)
        best = int(distances.argmin())
        if distances[best] < least:
            least, nearest = float(distances[best]), int(some[best])
    return least, nearest


def _feet(places: np.ndarray, body: np.ndarray) -> np.ndarray:
    """The nearest points (N, 3) of a body (K, 3, 3) to points (N, 3)."""
    pairs = np.repeat(places, len(body), axis=0)
    feet = closest_on_triangles(pairs, np.tile(body, (len(places), 1, 1)))
    distances = np.linalg.norm(feet - pairs, axis=1).reshape(len(places), -1)
    return feet.reshape(len(places), -1, 3)[np.arange(len(places)), distances.argmin(axis=1)]
