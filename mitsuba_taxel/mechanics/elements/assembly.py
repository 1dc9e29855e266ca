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
from mitsuba_taxel.mechanics.elements.internal_variables import Softening, StressUpdate
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
    """The equations of a mesh of one material, assembled over the numbered unknowns.

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
        """Pattern of the non-zero entries of the sum of element matrices, before constraints."""
        if self._like:
            return self._like.sparsity
        nodes, corners, count = self.elements.nodes, self.elements.corners, self._nodes
        return self._kept(_SPARSITIES, (nodes, corners, np.array(count)), lambda: Sparsity(nodes, corners, count))

    def evaluate(
        self,
        displacement: np.ndarray,
        pressure: np.ndarray,
        with_tangent: bool = True,
        stress_update: StressUpdate | Softening | None = None,
    ) -> InternalForces:
        """Internal forces and tangent at a state, without load.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacements of the nodes in mm.
        pressure : (corners,) ndarray
            Pressure at each corner of the elements in MPa, positive in tension.
        stress_update : StressUpdate or Softening, optional
            Isochoric stress of a viscoelastic solid, or of one with Mullins' effect.

        Returns
        -------
        InternalForces
            The internal forces and the tangent; NaN if an element is inverted.
        """
        state = self.elements.evaluate(displacement, pressure, with_tangent, stress_update)
        if not state.min_jacobian > 0:
            return InternalForces(np.full(self.unknowns, np.nan), None, state.min_jacobian)
        nodal, entries, rotation = self._nodal(state.forces, state.volumes), None, self.numbering.rotation
        if state.matrices is not None:
            entries = self.sparsity.summed(state.matrices.blocks, state.matrices.mixed, state.matrices.pressures)
            if rotation is not None:
                on_plate = nodal[: 3 * self._nodes].reshape(-1, 3)[rotation.nodes]
                entries = np.concatenate([entries, rotation.entries(displacement, on_plate)])
        return InternalForces(self.numbering.over_unknowns(nodal, displacement), entries, state.min_jacobian)

    def matrix(self, entries: np.ndarray) -> sparse.csc_matrix:
        """Lower triangle of the tangent over the unknowns, from its entries at a state."""
        return self._pattern.matrix(entries)

    def over_unknowns(
        self, forces: np.ndarray, volumes: np.ndarray, displacement: np.ndarray | None = None
    ) -> np.ndarray:
        """Sum (unknowns,) of element forces (m, 10, 3) and volumes (m, 4) at each unknown of the pad: the residual; see
        :meth:`Numbering.over_unknowns`.
        """
        return self.numbering.over_unknowns(self._nodal(forces, volumes), displacement)

    def _nodal(self, forces: np.ndarray, volumes: np.ndarray) -> np.ndarray:
        """Sum (3 N + corners,) of element forces and volumes at each node and corner."""
        degrees = 3 * self.elements.nodes[:, :, None] + np.arange(3)
        displacements = np.bincount(degrees.ravel(), forces.ravel(), 3 * self._nodes)
        corners = len(self.numbering.unknown) - 3 * self._nodes
        pressures = np.bincount(self.elements.corners.ravel(), volumes.ravel(), corners)
        return np.concatenate([displacements, pressures])

    @cached_property
    def _pattern(self) -> _Pattern:
        number, kind = self.numbering, _Pattern
        determined_by = [self.elements.nodes, self.elements.corners, number.unknown, number.sign]
        if number.rotation is not None:
            determined_by += [number.rotation.nodes, number.rotation.unknowns, number.rotation.spread]
            kind = _RotationPattern
        return self._kept(_PATTERNS, tuple(determined_by), lambda: kind(self.sparsity, number))

    def _kept(self, recent: Recent[_Made], arrays: tuple[np.ndarray, ...], make: Callable[[], _Made]) -> _Made:
        return recent.of(arrays, make) if len(self.elements.nodes) <= MOST_KEPT else make()


class _Pattern:
    """For each entry of the mesh's matrix: the position, in the sparse lower triangle over the unknowns, to which it is
    added.
    """

    def __init__(self, sparsity: Sparsity, numbering: Numbering) -> None:
        # Indices of 32 bits and factors of 8 halve the memory of the patterns of large pads.
        unknown = numbering.unknown.astype(np.int32)
        rows, columns = sparsity.degrees_of_freedom()
        first, second = unknown[rows], unknown[columns]
        self._size = numbering.displacements + numbering.pressures
        self._kept = np.flatnonzero((first >= 0) & (second >= 0) & (rows >= columns)).astype(np.int32)
        first, second = first[self._kept], second[self._kept]
        rows, columns = rows[self._kept], columns[self._kept]
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


class _RotationPattern(_Pattern):
    """Map from the entries of the mesh's matrix to the matrix over the unknowns, for a pad under a plate that rotates.
    The entries of the plate's rotation follow those of the elements."""

    def __init__(self, sparsity: Sparsity, numbering: Numbering) -> None:
        super().__init__(sparsity, numbering)
        assert numbering.rotation is not None
        self._rotation, self._numbering, self._count = numbering.rotation, numbering, sparsity.entries
        nodes, turning, degrees = self._rotation.nodes, self._rotation.unknowns, len(numbering.unknown)
        self._degrees = (3 * nodes[:, None] + np.arange(3)).ravel()
        place = np.full(degrees, -1)
        place[self._degrees] = np.arange(len(self._degrees))

        # Rows of the full symmetric matrix at the plate: entries of the lower triangle, and their transposes.
        of_row, of_column = sparsity.degrees_of_freedom()
        row, column = place[of_row], place[of_column]
        below = np.flatnonzero((of_row >= of_column) & (row >= 0))
        above = np.flatnonzero((of_row > of_column) & (column >= 0))
        self._at_plate = np.concatenate([below, above])
        self._places = np.concatenate([row[below], column[above]])
        self._others = np.concatenate([of_column[below], of_row[above]])

        # The pattern: that of the elements, the unknowns beside the plate, and the rotation itself.
        unknown = numbering.unknown[self._others]
        self._near = np.unique(unknown[unknown >= 0])
        first, second = np.tril_indices(len(turning))
        self._own = first, second
        columns = np.repeat(np.arange(self._size), np.diff(self._indptr))
        pairs = np.repeat(turning, len(self._near)), np.tile(self._near, len(turning))
        rows = np.concatenate([self._indices, np.maximum(*pairs), turning[first]])
        columns = np.concatenate([columns, np.minimum(*pairs), turning[second]])
        self._order = np.lexsort([rows, columns])
        self._all_indices = rows[self._order].astype(np.int32)
        counts = np.bincount(columns, minlength=self._size)
        self._all_indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)

    def matrix(self, entries: np.ndarray) -> sparse.csc_matrix:
        """Tangent matrix of a pad under a plate that rotates. Its columns of the rotation are K J, and its block of the
        rotation is J^T K J + G. Here K is the matrix of the free nodes, J the derivative of the nodes' positions with
        respect to the rotation, and G the stiffness of forces that rotate.
        """
        elements, rates, geometric = np.split(entries, [self._count, len(entries) - 9])
        spread, number = self._rotation.spread, self._numbering
        rates = rates.reshape(-1, 3) @ spread
        shape = (len(self._degrees), len(number.unknown))
        at_plate = sparse.csr_array((elements[self._at_plate], (self._places, self._others)), shape=shape)
        coupled = np.asarray(at_plate.T @ rates)
        own = rates.T @ coupled[self._degrees] + spread.T @ geometric.reshape(3, 3) @ spread
        free = number.unknown >= 0
        weighted = (number.sign[:, None] * coupled)[free]
        beside = [np.bincount(number.unknown[free], column, self._size)[self._near] for column in weighted.T]
        data = np.concatenate([super().matrix(elements).data, *beside, own[self._own]])
        shape = (self._size, self._size)
        return sparse.csc_matrix((data[self._order], self._all_indices, self._all_indptr), shape=shape)
