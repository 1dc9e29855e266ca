"""Curved triangles: polynomials of fourth degree through 15 points, which approximate spheres to some 1e-6."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.transport.rules import differentiated, monomials

DEGREE = 4
LATTICE = np.array([(i, j) for j in range(DEGREE + 1) for i in range(DEGREE + 1 - j)]) / DEGREE
"""Coordinates (s, t) (15, 2) of the 15 points of a patch."""
_COEFFICIENTS = differentiated(DEGREE) @ np.linalg.inv(monomials(LATTICE, DEGREE))
"""Matrices (3, 15, 15) from points to the polynomial through them, and to its derivatives with respect to s and t."""


@dataclass(frozen=True, eq=False)
class PatchPoints:
    """P points on curved patches, each given by its patch and two coordinates on it.

    Attributes
    ----------
    face : (P,) ndarray
        Number of the patch of each point, in ascending order.
    at : (P, 2) ndarray
        Coordinates (s, t) of each point on its patch.
    """

    face: np.ndarray
    at: np.ndarray

    @cached_property
    def _of_faces(self) -> list[tuple[int, slice]]:
        """Group the points by patch: the patches that have points, and the slice of the points of each."""
        faces, counts = np.unique(self.face, return_counts=True)
        ends = np.cumsum(counts)
        starts = ends - counts
        rows = zip(faces.tolist(), starts.tolist(), ends.tolist(), strict=True)
        return [(face, slice(start, end)) for face, start, end in rows]

    @cached_property
    def _monomials(self) -> np.ndarray:
        """Values (15, P) of the 15 monomials in (s, t) at the points."""
        return monomials(self.at, DEGREE).T

    def _evaluated(self, positions: np.ndarray, polynomials: np.ndarray) -> np.ndarray:
        """Values (K, P, 3) of K polynomials at the points. K matrices (K, 15, 15) from `_COEFFICIENTS` compute the
        polynomials from the positions.
        """
        factors = np.swapaxes(positions, 1, 2) @ polynomials.reshape(-1, len(LATTICE)).T
        factors = factors.reshape(len(positions), -1, len(LATTICE))
        result = np.empty((factors.shape[1], len(self.face)))
        for face, points in self._of_faces:
            np.matmul(factors[face], self._monomials[:, points], out=result[:, points])
        return result.reshape(3, len(polynomials), -1).transpose(1, 2, 0)

    def interpolated(self, positions: np.ndarray) -> np.ndarray:
        """Positions of the points in space, from the positions of the patches on which they lie.

        Parameters
        ----------
        positions : (F, 15, 3) ndarray
            Positions of the patches, in mm.

        Returns
        -------
        (P, 3) ndarray
            Positions in mm.
        """
        return self._evaluated(positions, _COEFFICIENTS[:1])[0]

    def positions_and_areas(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and area normals of the points.

        Parameters
        ----------
        positions : (F, 15, 3) ndarray
            Positions of the patches, in mm.

        Returns
        -------
        at : (P, 3) ndarray
            Positions in mm.
        area : (P, 3) ndarray
            Normals, whose length is the area per unit of s and t.
        """
        at, by_s, by_t = self._evaluated(positions, _COEFFICIENTS)
        return at, cross(by_s, by_t)

    def gradient(self, positions: np.ndarray, by_position: np.ndarray, by_area: np.ndarray) -> np.ndarray:
        """Derivatives of a function of the points with respect to the positions of the patches.

        Parameters
        ----------
        positions : (F, 15, 3) ndarray
            Positions of the patches, in mm.
        by_position, by_area : (P, 3) ndarray
            Derivatives of the function with respect to position and area normal of each point.

        Returns
        -------
        (F, 15, 3) ndarray
            Derivatives per mm.
        """
        by_s, by_t = self._evaluated(positions, _COEFFICIENTS[1:])
        # Derivatives with respect to the position and to both tangents, whose cross product is the area normal.
        adjoint = np.concatenate([by_position.T, cross(by_t, by_area).T, cross(by_area, by_s).T])
        summed = np.zeros((len(positions), len(adjoint), len(LATTICE)))
        for face, points in self._of_faces:
            np.matmul(adjoint[:, points], self._monomials[:, points].T, out=summed[face])
        return np.einsum("kmc,fkxm->fcx", _COEFFICIENTS, summed.reshape(len(positions), 3, 3, -1))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products (P, 3); several times as fast as numpy's."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]).T
