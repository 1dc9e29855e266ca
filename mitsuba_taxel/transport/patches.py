"""Curved triangles: polynomials of fourth degree through 15 points, which approximate spheres to some 1e-6."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.transport.rules import differentiated, monomials

DEGREE = 4
LATTICE = np.array([(i, j) for j in range(DEGREE + 1) for i in range(DEGREE + 1 - j)]) / DEGREE
"""(15, 2) coordinates (s, t) of the points of a patch."""
_COEFFICIENTS = differentiated(DEGREE) @ np.linalg.inv(monomials(LATTICE, DEGREE))
"""(3, 15, 15) matrices from points to the polynomial through them, and to its derivatives by s and t."""


@dataclass(frozen=True, eq=False)
class PatchPoints:
    """Points of patches.

    Attributes
    ----------
    face : (P,) ndarray
        Number of the patch, in ascending order.
    at : (P, 2) ndarray
        Coordinates (s, t) on it.
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
    def _monomials(self) -> np.ndarray:
        """(15, P)"""
        return monomials(self.at, DEGREE).T

    def _evaluated(self, places: np.ndarray, polynomials: np.ndarray) -> np.ndarray:
        """(K, P, 3) values of K polynomials (K, 15, 15) of the positions of the patches."""
        factors = np.swapaxes(places, 1, 2) @ polynomials.reshape(-1, len(LATTICE)).T
        factors = factors.reshape(len(places), -1, len(LATTICE))
        result = np.empty((factors.shape[1], len(self.face)))
        for face, points in self._of_faces:
            np.matmul(factors[face], self._monomials[:, points], out=result[:, points])
        return result.reshape(3, len(polynomials), -1).transpose(1, 2, 0)

    def places(self, places: np.ndarray) -> np.ndarray:
        """(P, 3) positions on patches with ``places`` (F, 15, 3)."""
        return self._evaluated(places, _COEFFICIENTS[:1])[0]

    def placed(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (P, 3), and area normals (P, 3), whose length is the area per unit of s and t."""
        at, one, other = self._evaluated(places, _COEFFICIENTS)
        return at, cross(one, other)

    def gradient(self, places: np.ndarray, by_place: np.ndarray, by_area: np.ndarray) -> np.ndarray:
        """(F, 15, 3) derivatives by the patches' positions, from those (P, 3) by position and area normal of the
        points."""
        one, other = self._evaluated(places, _COEFFICIENTS[1:])
        given = np.concatenate([by_place.T, cross(other, by_area).T, cross(by_area, one).T])
        summed = np.zeros((len(places), len(given), len(LATTICE)))
        for face, points in self._of_faces:
            np.matmul(given[:, points], self._monomials[:, points].T, out=summed[face])
        return np.einsum("kmc,fkxm->fcx", _COEFFICIENTS, summed.reshape(len(places), 3, 3, -1))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(P, 3) cross products; several times as fast as numpy's."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]).T
