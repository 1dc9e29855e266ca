"""Curved triangles: polynomials of fourth degree through 15 places, which follow spheres to some 1e-6."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.transport.rules import monomial_slopes, monomials

DEGREE = 4
LATTICE = np.array([(i, j) for j in range(DEGREE + 1) for i in range(DEGREE + 1 - j)]) / DEGREE
"""(15, 2) where the places of a patch lie on it, as (s, t)."""
_COEFFICIENTS = np.linalg.inv(monomials(LATTICE, DEGREE))


@dataclass(frozen=True, eq=False)
class Points:
    """Points of patches.

    Attributes
    ----------
    face : (P,) ndarray
        Number of the patch; in order.
    at : (P, 2) ndarray
        Where on it, as (s, t).
    """

    face: np.ndarray
    at: np.ndarray

    @cached_property
    def _of_faces(self) -> list[tuple[int, slice]]:
        faces, counts = np.unique(self.face, return_counts=True)
        ends = np.cumsum(counts)
        starts = ends - counts
        return [
            (face, slice(*both)) for face, *both in zip(*(each.tolist() for each in (faces, starts, ends)), strict=True)
        ]

    @cached_property
    def _weights(self) -> np.ndarray:
        """(P, 15) of the places of a patch in that of a point."""
        return monomials(self.at, DEGREE) @ _COEFFICIENTS

    @cached_property
    def _slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the weights by s and t."""
        by_s, by_t = monomial_slopes(self.at, DEGREE)
        return by_s @ _COEFFICIENTS, by_t @ _COEFFICIENTS

    def _weighted(self, weights: np.ndarray, places: np.ndarray) -> np.ndarray:
        result = np.empty((len(self.face), 3))
        for face, points in self._of_faces:
            np.matmul(weights[points], places[face], out=result[points])
        return result

    def places(self, places: np.ndarray) -> np.ndarray:
        """(P, 3) on patches with ``places`` (F, 15, 3)."""
        return self._weighted(self._weights, places)

    def sides(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(P, 3) each, derivatives of a place by s and t."""
        return self._weighted(self._slopes[0], places), self._weighted(self._slopes[1], places)

    def gradient(self, places: np.ndarray, by_place: np.ndarray, by_normal: np.ndarray) -> np.ndarray:
        """(F, 15, 3) derivatives by the patches' places, of what has such derivatives (P, 3) by place and area normal
        of the points."""
        one, other = self.sides(places)
        parts = list(
            zip((self._weights, *self._slopes), (by_place, cross(other, by_normal), cross(by_normal, one)), strict=True)
        )
        result = np.zeros((len(places), len(LATTICE), 3))
        for face, points in self._of_faces:
            result[face] = sum(weights[points].T @ values[points] for weights, values in parts)
        return result


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(P, 3) products of vectors; several times as fast as numpy's."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    product = np.empty_like(a)
    for k, (p, q, r, s) in enumerate(((ay, bz, az, by), (az, bx, ax, bz), (ax, by, ay, bx))):
        product[:, k] = p * q - r * s
    return product
