"""The least distance between the cells of a pad and the packages in them, and its derivatives."""

from __future__ import annotations

import math
from collections.abc import Iterator

import mitsuba as mi
import numpy as np

from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.surfaces.triangles import closest_on_triangles
from mitsuba_taxel.mechanics import State
from mitsuba_taxel.mechanics.contact.barriers.bodies import body_of_each
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.sensing.derivatives.linearised_pad import Nodal
from mitsuba_taxel.sensing.scene.clearance import packages

WALLS = (REGIONS["roof"], REGIONS["side"])
_SAMPLES = shape_functions(np.array([[6 - i - j, i, j] for i in range(7) for j in range(7 - i)]) / 6)
"""Shape functions (28, 6) at the points of a face whose distance is computed."""
_AT_ONCE = 32
"""Number of points whose distance from a body is computed at a time."""


class PackageClearance:
    """Clearance of a pad: the least distance between its packages and its cells' walls, sampled at 28 points of each
    face.

    Attributes
    ----------
    value : float
        Clearance in mm; NaN if the scene has no packages.
    """

    def __init__(self, state: State, bodies: list[np.ndarray]) -> None:
        self.value = math.nan
        faces = state.mesh.faces[np.isin(state.mesh.face_region, WALLS)]
        points = np.einsum("pk,fki->fpi", _SAMPLES, (state.mesh.points + state.displacement)[faces]).reshape(-1, 3)
        least = math.inf
        for body in _separate(bodies):
            distance, number = _nearest(points, body, least)
            if distance < least:
                self.value = least = distance
                self._body, self._point, self._nodes = body, points[number], faces[number // len(_SAMPLES)]
                self._weights = _SAMPLES[number % len(_SAMPLES)]

    def rate(self, nodal: Nodal, changed: list[tuple[float, list[np.ndarray]]]) -> float:
        """Derivative of the clearance with respect to a parameter, in mm per unit of the parameter.

        It is the rate of the distance at the nearest point: to first order, a change of the nearest point has no
        effect.

        Parameters
        ----------
        nodal : Nodal
            Rates of change of the nodes with the parameter.
        changed : list[tuple[float, list[ndarray]]]
            Terms of a finite difference: the weight, and the packages as the corners (K, 3, 3) of K triangles. Empty if
            the parameter does not move packages.
        """
        if math.isnan(self.value):
            return math.nan
        direction = self._vector_from(self._body) / max(self.value, np.finfo(float).tiny)
        velocity = self._weights @ (nodal.displacement + nodal.velocity)[self._nodes]
        by_packages = sum(weight * min(map(self._distance_from, bodies)) for weight, bodies in changed)
        return float(direction @ velocity) + float(by_packages)

    def _vector_from(self, body: np.ndarray) -> np.ndarray:
        return self._point - _closest(self._point[None], body)[0]

    def _distance_from(self, body: np.ndarray) -> float:
        return float(np.linalg.norm(self._vector_from(body)))


def clearances(
    state: State, nodal: list[Nodal], scene: mi.Scene, changed: list[list[tuple[float, mi.Scene]]]
) -> tuple[float, np.ndarray]:
    """The clearance in mm between the pad and the packages of a scene, and its derivatives (P,) with respect to P
    parameters.

    Parameters
    ----------
    nodal : list[Nodal]
        Rates of change of the nodes with each parameter.
    changed : list[list[tuple[float, mi.Scene]]]
        For each parameter, the terms of a finite difference: weight and scene. Empty if the parameter changes the pad
        only.
    """
    clearance = PackageClearance(state, packages(scene))
    bodies = [[(weight, packages(live)) for weight, live in stencil] for stencil in changed]
    return clearance.value, np.array([clearance.rate(*change) for change in zip(nodal, bodies, strict=True)])


def _separate(bodies: list[np.ndarray]) -> Iterator[np.ndarray]:
    """Divide each body, which may hold several packages, into single packages."""
    for body in bodies:
        number = body_of_each(body)
        yield from (body[number == k] for k in range(number.max() + 1))


def _nearest(points: np.ndarray, body: np.ndarray, least: float) -> tuple[float, int]:
    """The least distance of N points (N, 3) from a body of K triangles (K, 3, 3), and the index of the nearest point;
    ``least`` and -1 if no point is nearer than ``least``.

    The distance from the bounding box of the body is a lower bound. Points are sorted by this bound, and the search
    ends where the bound exceeds the least distance found so far.
    """
    low, high = body.min(axis=(0, 1)), body.max(axis=(0, 1))
    lower = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=1)
    first = int(lower.argmin())
    bound = min(least, float(np.linalg.norm(_closest(points[first : first + 1], body) - points[first])))
    candidates = np.flatnonzero(lower <= bound)
    order, nearest = candidates[np.argsort(lower[candidates], kind="stable")], -1
    for start in range(0, len(order), _AT_ONCE):
        block = order[start : start + _AT_ONCE]
        if lower[block[0]] >= least:
            break
        distances = np.linalg.norm(_closest(points[block], body) - points[block], axis=1)
        best = int(distances.argmin())
        if distances[best] < least:
            least, nearest = float(distances[best]), int(block[best])
    return least, nearest


def _closest(points: np.ndarray, body: np.ndarray) -> np.ndarray:
    """The points (N, 3) of a body of K triangles (K, 3, 3) that are closest to each of N points (N, 3)."""
    repeated = np.repeat(points, len(body), axis=0)
    on_triangles = closest_on_triangles(repeated, np.tile(body, (len(points), 1, 1)))
    distances = np.linalg.norm(on_triangles - repeated, axis=1).reshape(len(points), -1)
    return on_triangles.reshape(len(points), -1, 3)[np.arange(len(points)), distances.argmin(axis=1)]
