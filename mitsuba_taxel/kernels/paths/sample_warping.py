"""Hierarchical sample warping: sampling of members by a tree that preserves the locality of samples.

A tree of depth d has 2**d leaves and is stored as the shares of its 2**d inner nodes, numbered from 1: the share of a
node's weight in its left subtree. The two coordinates of a sample decide alternately, the first one first.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np


@dr.syntax
def descend(shares: mi.Float, depth: mi.UInt32, tree: mi.UInt32, sample: mi.Point2f) -> tuple[mi.UInt32, mi.Point2f]:
    """The leaf that a sample leads to, and the sample rescaled to be uniform again.

    Parameters
    ----------
    shares : mi.Float
        (trees * 2**depth,) shares of the inner nodes, tree after tree.
    depth : mi.UInt32
        Common depth of all trees; opaque, so that trees of every depth share a kernel.
    tree : mi.UInt32
        Number of the tree to walk down.
    """
    deciding, other = mi.Float(sample.x), mi.Float(sample.y)
    node, level = mi.UInt32(1), mi.UInt32(0)
    while level < depth:
        share = dr.gather(mi.Float, shares, (tree << depth) + node)
        right = deciding >= share
        left_over = dr.select(right, (deciding - share) / (1 - share), deciding / share)
        deciding, other = other, dr.clip(left_over, 0, dr.one_minus_epsilon(mi.Float))
        node = 2 * node + dr.select(right, mi.UInt32(1), mi.UInt32(0))
        level += 1
    even = (depth & 1) == 0
    rest = mi.Point2f(dr.select(even, deciding, other), dr.select(even, other, deciding))
    return node - (mi.UInt32(1) << depth), rest


def shares_of_grid(weight: np.ndarray) -> np.ndarray:
    """(T, n * n) shares of trees over grids of ``weight`` (T, n, n), n a power of two; columns are split first."""
    trees, side, _ = weight.shape
    shares = np.ones((trees, side * side), np.float32)
    rows, columns = 1, 1
    for level in range(2 * (side.bit_length() - 1)):
        columns, rows = (2 * columns, rows) if level % 2 == 0 else (columns, 2 * rows)
        part = weight.reshape(trees, rows, side // rows, columns, side // columns).sum(axis=(2, 4))
        node = _interleaved(rows, columns, level + 1)
        below = np.zeros((trees, 2 << level))
        below[:, node] = part
        whole = below[:, 0::2] + below[:, 1::2]
        shares[:, 1 << level : 2 << level] = np.divide(below[:, 0::2], whole, out=np.ones_like(whole), where=whole > 0)
    return shares


def _interleaved(rows: int, columns: int, levels: int) -> np.ndarray:
    """(rows, columns) index within its level of the node over each block of the grid: interleaved column and row
    bits."""
    row, column = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    place = np.zeros_like(row)
    row_bits, column_bits = rows.bit_length() - 1, columns.bit_length() - 1
    for level in range(levels):
        if level % 2 == 0:
            column_bits -= 1
            bit = column >> column_bits & 1
        else:
            row_bits -= 1
            bit = row >> row_bits & 1
        place = 2 * place + bit
    return place


class MemberTrees:
    """Trees over scattered members, halved by number along the two axes alternately.

    Parameters
    ----------
    position : (M, 2) ndarray
        Positions of the members.
    tree : (M,) ndarray
        Number of the tree of each member.
    trees : int
        Number of trees.

    Attributes
    ----------
    depth : int
        Of all trees.
    leaves : (trees, 2**depth) ndarray
        Number of the member in each leaf; 0 if empty.
    """

    def __init__(self, position: np.ndarray, tree: np.ndarray, trees: int) -> None:
        count = len(tree)
        self.depth = max(1, int(np.bincount(tree).max() - 1).bit_length())
        ranks = np.argsort(np.argsort(position, axis=0), axis=0)
        node = np.ones(count, dtype=np.int64)
        for level in range(self.depth):
            place = (tree << level) + node - (1 << level)  # one number for each node of this level
            order = np.argsort(place * count + ranks[:, level % 2])
            size = np.bincount(place, minlength=trees << level)
            rank = np.empty_like(node)
            rank[order] = np.arange(count) - (np.cumsum(size) - size)[place[order]]
            node = 2 * node + (rank >= size[place] // 2)
        self._leaf = (tree << self.depth) + node - (1 << self.depth)
        self.leaves = np.zeros((trees, 1 << self.depth), np.uint32)
        self.leaves.ravel()[self._leaf] = np.arange(count)

    def shares(self, weight: np.ndarray) -> np.ndarray:
        """(trees, 2**depth) shares for members of ``weight`` (M,), not negative."""
        shares, below = np.ones(self.leaves.shape, np.float32), np.zeros(self.leaves.shape)
        below.ravel()[self._leaf] = weight
        for level in reversed(range(self.depth)):
            left = below[:, 0::2]
            below = left + below[:, 1::2]
            shares[:, 1 << level : 2 << level] = np.divide(left, below, out=np.ones_like(left), where=below > 0)
        return shares

    def boxes(self, shares: np.ndarray) -> np.ndarray:
        """(M, 4) the part of the unit square that ``shares`` map to each member: lower corner and size."""
        low, size = np.zeros((2, len(shares), 1)), np.ones((2, len(shares), 1))
        for level in range(self.depth):
            axis, share = level % 2, shares[:, 1 << level : 2 << level].astype(float)
            low, size = np.repeat(low, 2, axis=2), np.repeat(size, 2, axis=2)
            low[axis, :, 1::2] += share * size[axis, :, 1::2]
            size[axis, :, 0::2] *= share
            size[axis, :, 1::2] *= 1 - share
        return np.concatenate([low, size]).reshape(4, -1).T[self._leaf]
