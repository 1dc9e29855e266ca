"""Finite rotation of a rigid plate, whose unknowns are the components of its rotation vector.

A node with the undeformed position X on a plate with the pivot C is displaced by d + (R - 1) (X - C), where
R = exp([theta]) for the rotation vector theta. The plate's energy under a force f on C and a moment m is
-f . d - m . theta, so that the forces of the nodes and the tangent are exact first and second derivatives, and the
tangent is symmetric. The moment m is conjugate to the rotation vector: it equals the moment in space for rotations
about its own axis, and to first order differs from it by half the product of theta and m otherwise (M. Ritto-Correa and
D. Camotim, Int. J. Solids Struct. 40, 2829, 2003; J. H. Argyris et al., Comput. Methods Appl. Mech. Eng. 32, 85, 1982).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from mitsuba_taxel.base.caches import kept


@dataclass(frozen=True, eq=False)
class PlateRotation:
    """Rotation of a rigid plate about its pivot, as a part of the unknowns of a pad.

    Its unknowns are "turns": the rotation vector times a length ``size``, so that all unknowns of the pad are lengths.

    Attributes
    ----------
    nodes : (p,) ndarray of int
        Nodes of the plate.
    arms : (p, 3) ndarray
        Undeformed positions relative to the pivot, mm.
    size : float
        Length in mm by which rotations are multiplied.
    unknowns : (k,) ndarray of int
        Numbers of the k unknowns of the rotation among those of the pad.
    spread : (3, k) ndarray
        Matrix that multiplies these unknowns to give the turns.
    """

    nodes: np.ndarray
    arms: np.ndarray
    size: float
    unknowns: np.ndarray
    spread: np.ndarray

    @classmethod
    def of(
        cls, nodes: np.ndarray, arms: np.ndarray, size: float, unknown: np.ndarray, sign: np.ndarray
    ) -> PlateRotation:
        """Create the rotation of a plate. ``unknown`` (3,) has the number of the unknown for each component of the
        turn, -1 for a component that is 0; ``sign`` (3,) has the factors of these unknowns.
        """
        unknowns = np.unique(unknown[unknown >= 0])
        return cls(nodes, arms, size, unknowns, sign[:, None] * (unknown[:, None] == unknowns))

    @property
    def over_unknowns(self) -> np.ndarray:
        """Matrix (k, 3) from turns of the plate (rotation vector times its size) to the unknowns of the rotation."""
        return self.spread.T / np.maximum(np.abs(self.spread).sum(axis=0), 1)[:, None]

    def turns_of(self, unknowns: np.ndarray) -> np.ndarray:
        """Turn (3,) of the plate, its rotation vector times a length, in mm, from the unknowns of the pad."""
        return self.spread @ unknowns[self.unknowns]

    def displacement(self, turns: np.ndarray) -> np.ndarray:
        """Displacement (p, 3) in mm of the plate's nodes when it rotates by a turn (3,) about the undisplaced pivot."""
        return self.arms @ (rotation_matrix(turns / self.size) - np.eye(3)).T

    def turns_at(self, displacement: np.ndarray) -> np.ndarray:
        """Turn (3,) of the plate, its rotation vector times a length, in mm, at a displacement (N, 3) of the mesh's
        nodes.
        """
        return self.size * rotation_vector(self.arms, displacement[self.nodes])

    def rates(self, displacement: np.ndarray | None) -> np.ndarray:
        """Derivatives (p, 3, 3) of the displacements of the nodes with respect to the turns.

        Parameters
        ----------
        displacement : (N, 3) ndarray or None
            Displacement of the mesh's nodes, mm; None at rest.
        """
        turns = np.zeros(3) if displacement is None else self.turns_at(displacement)
        first, _ = rotation_derivatives(tuple(turns / self.size))
        return np.einsum("kij,pj->pik", first, self.arms) / self.size

    def entries(self, displacement: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Entries of the tangent for the unknowns of the plate's rotation, which are appended to the entries of the
        elements.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement of the mesh's nodes, mm.
        forces : (p, 3) ndarray
            Internal forces at the nodes, N.

        Returns
        -------
        (9 p + 9,) ndarray
            The rates, and the stiffness in N/mm of constant forces that turn about the pivot.
        """
        _, second = rotation_derivatives(tuple(self.turns_at(displacement) / self.size))
        geometric = np.einsum("klij,pi,pj->kl", second, forces, self.arms) / self.size**2
        return np.concatenate([self.rates(displacement).ravel(), geometric.ravel()])


def rotation_matrix(vector: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector.

    Parameters
    ----------
    vector : (3,) ndarray
        Rotation vector in radians.

    Returns
    -------
    (3, 3) ndarray
        The matrix.
    """
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def rotation_vector(points: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Rotation vector of the rigid motion that is nearest to a displacement (W. Kabsch, Acta Cryst. A 32, 922, 1976).

    Parameters
    ----------
    points : (p, 3) ndarray
        Undeformed points, not on a line.
    displacement : (p, 3) ndarray
        Their displacements.

    Returns
    -------
    (3,) ndarray
        Rotation vector in radians, of a length up to pi.
    """
    arms, moved = points - points.mean(axis=0), points + displacement
    left, _, right = np.linalg.svd((moved - moved.mean(axis=0)).T @ arms)
    signs = np.array([1.0, 1.0, np.linalg.det(left @ right)])
    return np.asarray(Rotation.from_matrix((left * signs) @ right).as_rotvec())


@kept(8)
def rotation_derivatives(vector: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivatives of the rotation matrix with respect to the rotation vector.

    They are blocks of the exponentials of larger matrices, exact for all rotations (N. J. Higham and S. D. Relton, SIAM
    J. Matrix Anal. Appl. 35, 1019, 2014).

    Parameters
    ----------
    vector : (3,) tuple
        Rotation vector in radians.

    Returns
    -------
    first : (3, 3, 3) ndarray
        Derivative of the matrix with respect to each component.
    second : (3, 3, 3, 3) ndarray
        Derivative with respect to each pair of components.
    """
    generators = [np.cross(axis, np.eye(3)).T for axis in np.eye(3)]
    skew = sum(component * generator for component, generator in zip(vector, generators, strict=True))
    first, second, none = np.empty((3, 3, 3)), np.empty((3, 3, 3, 3)), np.zeros((3, 3))
    for k in range(3):
        for j in range(k + 1):
            a, b = generators[k], generators[j]
            blocks = [[skew, a, b, none], [none, skew, none, b], [none, none, skew, a], [none, none, none, skew]]
            exponential = expm(np.block(blocks))
            first[k] = exponential[:3, 3:6]
            second[k, j] = second[j, k] = exponential[:3, 9:]
    return first, second
