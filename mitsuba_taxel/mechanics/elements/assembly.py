"""Residual and tangent of a meshed solid over the unconstrained unknowns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.base.caches import Recent
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.constraints import Numbering
from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.elements.internal_variables import StressUpdate
from mitsuba_taxel.mechanics.elements.sparsity import Sparsity, equal_pairs
from mitsuba_taxel.mechanics.materials.laws import Material

MOST_KEPT = 1000
"""Largest number of elements of meshes whose patterns are cached, some 5 MB each: studies and optimisations solve many
pads with the same elements."""
_SPARSITIES: Recent[Sparsity] = Recent("sparsities of meshes", 8)
_PATTERNS: Recent[_Pattern] = Recent("patterns of matrices", 32)
_Made = TypeVar("_Made")


@dataclass(frozen=True)
class InternalForces:
    """Internal forces and tangent of a solid at a state.

    Attributes
    ----------
    residual : ndarray
        Forces in N and volumes in mm³ over the unknowns.
    entries : ndarray or None
        Entries of the tangent, in the order of :class:`Sparsity`; None if not requested, or if an element is inverted.
    min_jacobian : float
        Smallest volume ratio J at any quadrature point.
    """

    residual: np.ndarray
    entries: np.ndarray | None
    min_jacobian: float


class Assembly:
    """A mesh of one material, assembled over the unknowns of a numbering.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    material : Material
        Elastic law.
    numbering : Numbering
        Numbering of the unknowns.
    like : Assembly, optional
        Another assembly of the same mesh and material, whose elements it shares.
    linear : (m, q) ndarray, optional
        Mask of the quadrature points where the law is linear, q in each of m elements; see `Elements`.
    """

    def __init__(
        self,
        mesh: VolumeMesh,
        material: Material,
        numbering: Numbering,
        like: Assembly | None = None,
        linear: np.ndarray | None = None,
    ) -> None:
        self.numbering = numbering
        self.unknowns = numbering.displacements + numbering.pressures
        self.elements: Elements = like.elements if like else Elements(mesh, material, linear)
        self._nodes, self._like = len(mesh.points), like

    @cached_property
    def sparsity(self) -> Sparsity:
        """Pattern of the sum of element matrices, before constraints."""
        if self._like:
            return self._like.sparsity
        nodes, corners, count = self.elements.nodes, self.elements.corners, self._nodes
        return self._kept(_SPARSITIES, (nodes, corners, np.array(count)), lambda: Sparsity(nodes, corners, count))

    def evaluate(
        self,
        displacement: np.ndarray,
        pressure: np.ndarray,
        with_tangent: bool = True,
        stress_update: StressUpdate | None = None,
    ) -> InternalForces:
        """Internal forces and tangent at a state, without load.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacements of the nodes in mm.
        pressure : (corners,) ndarray
            Pressure at each corner of the elements in MPa, positive in tension.
        stress_update : StressUpdate, optional
            Isochoric stress of a viscoelastic solid.

        Returns
        -------
        InternalForces
            The internal forces and the tangent; NaN if an element is inverted.
        """
        state = self.elements.evaluate(displacement, pressure, with_tangent, stress_update)
        if not state.min_jacobian > 0:
            return InternalForces(np.full(self.unknowns, np.nan), None, state.min_jacobian)
        entries = None
        if state.matrices is not None:
            entries = self.sparsity.summed(state.matrices.blocks, state.matrices.mixed, state.matrices.pressures)
        return InternalForces(self.over_unknowns(state.forces, state.volumes), entries, state.min_jacobian)

    def matrix(self, entries: np.ndarray) -> sparse.csc_matrix:
        """Lower triangle of the tangent over the unknowns, from its entries at a state."""
        return self._pattern.matrix(entries)

    def over_unknowns(self, forces: np.ndarray, volumes: np.ndarray) -> np.ndarray:
        """Sum (unknowns,), for each unknown, of the forces (m, 10, 3) and volumes (m, 4) of m elements."""
        degrees = 3 * self.elements.nodes[:, :, None] + np.arange(3)
        displacements = np.bincount(degrees.ravel(), forces.ravel(), 3 * self._nodes)
        corners = len(self.numbering.unknown) - 3 * self._nodes
        pressures = np.bincount(self.elements.corners.ravel(), volumes.ravel(), corners)
        return self.numbering.over_unknowns(np.concatenate([displacements, pressures]))

    @cached_property
    def _pattern(self) -> _Pattern:
        number = self.numbering
        determined_by = self.elements.nodes, self.elements.corners, number.unknown, number.sign
        return self._kept(_PATTERNS, determined_by, lambda: _Pattern(self.sparsity, number))

    def _kept(self, recent: Recent[_Made], arrays: tuple[np.ndarray, ...], make: Callable[[], _Made]) -> _Made:
        return recent.of(arrays, make) if len(self.elements.nodes) <= MOST_KEPT else make()


class _Pattern:
    """Map from the entries of a mesh's matrix to the sparse lower triangle over the unknowns."""

    def __init__(self, sparsity: Sparsity, numbering: Numbering) -> None:
        # Indices of 32 bits and factors of 8 halve the memory of the patterns of large pads.
        unknown = numbering.unknown.astype(np.int32)
        first, second = unknown[sparsity.rows], unknown[sparsity.columns]
        self._size = numbering.displacements + numbering.pressures
        self._kept = np.flatnonzero((first >= 0) & (second >= 0) & sparsity.lower).astype(np.int32)
        first, second = first[self._kept], second[self._kept]
        rows, columns = sparsity.rows[self._kept], sparsity.columns[self._kept]
        low, high = np.minimum(first, second), np.maximum(first, second)
        column, self._indices, self._target = equal_pairs(low, high, self._size)
        count = np.bincount(column, minlength=self._size)
        self._indptr = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
        # Two degrees of freedom tied to the same unknown contribute to the diagonal twice.
        sign = numbering.sign.astype(np.int8)
        factor = np.where((first == second) & (rows != columns), np.int8(2), np.int8(1)) * sign[rows] * sign[columns]
        self._factor = None if np.all(factor == 1) else factor

    def matrix(self, entries: np.ndarray) -> sparse.csc_matrix:
        kept = entries[self._kept]
        if self._factor is not None:
            kept *= self._factor
        data = np.bincount(self._target, kept, len(self._indices))
        return sparse.csc_matrix((data, self._indices, self._indptr), shape=(self._size, self._size))
