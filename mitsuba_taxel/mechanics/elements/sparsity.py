"""Sparsity pattern of the degrees of freedom of a mesh, and sums of element matrices.

It does not depend on constraints, which :mod:`~mitsuba_taxel.mechanics.elements.assembly` applies. Each pair of nodes
has one block of 3 x 3, which keeps the search for equal pairs small.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.materials.moduli import PAIRS


class Sparsity:
    """The lower triangle of a symmetric matrix over the degrees of freedom of a mesh, as a list of entries.

    Blocks of two nodes' displacements come first, then those of a pressure and a displacement, then pressures.

    Parameters
    ----------
    nodes : (m, 10) ndarray
        Nodes of each element, ascending.
    corners : (m, 4) ndarray
        Corners of each element, which have a pressure.
    count : int
        Number of nodes.

    Attributes
    ----------
    entries : int
        Number E of entries.
    """

    def __init__(self, nodes: np.ndarray, corners: np.ndarray, count: int) -> None:
        self._count = count
        self._blocks = _Merged(nodes[:, PAIRS[1]], nodes[:, PAIRS[0]], count)
        self._mixed = _Merged(corners[:, :, None], nodes[:, None, :], count)
        self._pressures = _Merged(corners[:, :, None], corners[:, None, :], count)
        self.entries = 9 * len(self._blocks.keys) + 3 * len(self._mixed.keys) + len(self._pressures.keys)

    def degrees_of_freedom(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the entries. They are computed anew by each call, because they are needed once, and take
        as much memory as the entries.

        Returns
        -------
        rows, columns : (E,) ndarray of int32
            Degree of freedom of each entry: 3 of each node, then one of each corner.
        """
        component, pressures = np.arange(3, dtype=np.int32), 3 * self._count
        column, row = self._blocks.pairs
        rows = (3 * row[:, None] + np.repeat(component, 3)).ravel()
        columns = (3 * column[:, None] + np.tile(component, 3)).ravel()
        pressure, node = self._mixed.pairs
        first, second = self._pressures.pairs
        rows = np.concatenate([rows, np.repeat(pressures + pressure, 3), pressures + first])
        columns = np.concatenate([columns, (3 * node[:, None] + component).ravel(), pressures + second])
        return rows, columns

    def summed(self, blocks: np.ndarray, mixed: np.ndarray, pressures: np.ndarray) -> np.ndarray:
        """Entries of the sum of element matrices.

        Parameters
        ----------
        blocks : (m, pairs, 9) ndarray
            Flattened (3, 3) blocks of the displacements of each pair of nodes in :data:`PAIRS`.
        mixed : (m, 4, 30) ndarray
            Blocks of pressures and displacements.
        pressures : (m, 4, 4) ndarray
            Blocks of pressures.

        Returns
        -------
        (E,) ndarray
            Entries in the order of :meth:`degrees_of_freedom`.
        """
        sums = self._blocks.summed(blocks, 9), self._mixed.summed(mixed, 3), self._pressures.summed(pressures, 1)
        return np.concatenate(sums)

    def add_blocks(self, entries: np.ndarray, nodes: np.ndarray, matrices: np.ndarray) -> None:
        """Add n symmetric matrices (n, 3 k, 3 k) over the displacements of k nodes each; the nodes (n, k) of a matrix
        belong to one element."""
        order = np.argsort(nodes, axis=1)
        nodes = np.take_along_axis(nodes, order, axis=1)
        first, second = np.tril_indices(nodes.shape[1])
        positions = np.searchsorted(self._blocks.keys, nodes[:, second] * self._count + nodes[:, first])
        matrices = matrices.reshape(len(nodes), nodes.shape[1], 3, nodes.shape[1], 3)
        rows = np.arange(len(nodes))[:, None]
        blocks = matrices[rows, order[:, first], :, order[:, second]]
        np.add.at(entries[: 9 * len(self._blocks.keys)].reshape(-1, 3, 3), positions, blocks)


class _Merged:
    """Groups of equal pairs of numbers, all below ``size``; values are summed over each group."""

    def __init__(self, first: np.ndarray, second: np.ndarray, size: int) -> None:
        first, second = (array.ravel() for array in np.broadcast_arrays(first, second))
        rows, columns, target = equal_pairs(first, second, size)
        self._size, self.keys = size, rows.astype(np.int64) * size + columns
        # Factors of 8 bits and indices of 32: the sums of a large pad take as much memory as its matrix otherwise.
        ones, indices = np.ones(len(target), dtype=np.int8), np.arange(len(target), dtype=np.int32)
        self._sum = sparse.csr_array((ones, (target, indices)), shape=(len(self.keys), len(target)))

    @property
    def pairs(self) -> tuple[np.ndarray, ...]:
        """First and second number of each distinct pair, as 32-bit integers, which halve the memory of large patterns.
        """
        return tuple(numbers.astype(np.int32) for numbers in np.divmod(self.keys, self._size))

    def summed(self, values: np.ndarray, size: int) -> np.ndarray:
        """Sum blocks of ``size`` values over each group of equal pairs; the result is a flat array."""
        return (self._sum @ values.reshape(-1, size)).ravel()


def equal_pairs(first: np.ndarray, second: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The distinct pairs of two arrays of whole numbers. They are found by counting, which takes a third of the time of
    sorting.

    Parameters
    ----------
    first, second : (n,) ndarray of int
        Pairs of numbers below ``size``.
    size : int
        Upper limit of the numbers.

    Returns
    -------
    rows, columns : (k,) ndarray of int32
        Distinct pairs in ascending order.
    target : (n,) ndarray of int
        Index of each pair among these.
    """
    pairs = sparse.coo_array((np.arange(len(first), dtype=np.int32), (first, second)), shape=(size, size))
    pairs.has_canonical_format = True  # otherwise equal entries would be summed
    ordered = pairs.tocsc().tocsr()
    rows, columns = np.repeat(np.arange(size, dtype=np.int32), np.diff(ordered.indptr)), ordered.indices
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (rows[1:] != rows[:-1]) | (columns[1:] != columns[:-1])
    target = np.empty(len(rows), dtype=np.int32)
    target[ordered.data] = np.cumsum(new) - 1
    return rows[new], columns[new], target
