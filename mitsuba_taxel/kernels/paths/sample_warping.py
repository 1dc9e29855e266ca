"""Hierarchical sample warping: sampling of members by a tree that preserves the locality of samples.

A tree of depth d has 2**d leaves. It is stored as the split of each of its inner nodes, numbered from 1: the fraction
of the node's weight in its left subtree. The two coordinates of a sample decide alternately, starting with the first.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np


@dr.syntax
def descend(splits: mi.Float, depth: mi.UInt32, tree: mi.UInt32, sample: mi.Point2f) -> tuple[mi.UInt32, mi.Point2f]:
    """The leaf to which a tree maps a point of the unit square (sample), and that point rescaled so that it is uniform
    within the leaf.

    Parameters
    ----------
    splits : mi.Float
        Splits (trees * 2**depth,) of the inner nodes, tree after tree.
    depth : mi.UInt32
        Common depth of all trees; opaque, so that trees of all depths use the same kernel.
    tree : mi.UInt32
        Number of the tree.
    sample : mi.Point2f
        Uniform random numbers.

    Returns
    -------
    leaf, sample : mi.UInt32 and mi.Point2f
        Number of the leaf, and the rescaled sample.
    """
    deciding, next_coordinate = mi.Float(sample.x), mi.Float(sample.y)
    node, level = mi.UInt32(1), mi.UInt32(0)
    while level < depth:
        split = dr.gather(mi.Float, splits, (tree << depth) + node)
        right = deciding >= split
        rescaled = dr.select(right, (deciding - split) / (1 - split), deciding / split)
        deciding, next_coordinate = next_coordinate, dr.clip(rescaled, 0, dr.one_minus_epsilon(mi.Float))
        node = 2 * node + dr.select(right, mi.UInt32(1), mi.UInt32(0))
        level += 1
    even = (depth & 1) == 0
    rest = mi.Point2f(dr.select(even, deciding, next_coordinate), dr.select(even, next_coordinate, deciding))
    return node - (mi.UInt32(1) << depth), rest


def grid_splits(weight: np.ndarray) -> np.ndarray:
    """Splits (T, n * n) of T sampling trees over grids of n x n cells with ``weight`` (T, n, n), n a power of two;
    columns are split first. A split is the fraction of a node's weight in its left subtree.
    """
    trees, side, _ = weight.shape
    splits = np.ones((trees, side * side), np.float32)
    rows, columns = 1, 1
    for level in range(2 * (side.bit_length() - 1)):
        columns, rows = (2 * columns, rows) if level % 2 == 0 else (columns, 2 * rows)
        sums = weight.reshape(trees, rows, side // rows, columns, side // columns).sum(axis=(2, 4))
        node = _interleaved(rows, columns, level + 1)
        below = np.zeros((trees, 2 << level))
        below[:, node] = sums
        total = below[:, 0::2] + below[:, 1::2]
        splits[:, 1 << level : 2 << level] = np.divide(below[:, 0::2], total, out=np.ones_like(total), where=total > 0)
    return splits


def _interleaved(rows: int, columns: int, levels: int) -> np.ndarray:
    """Indices (rows, columns) of the tree nodes that correspond to the blocks of a grid, in one level of the tree. An
    index consists of the interleaved bits of column and row.
    """
    row, column = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    index = np.zeros_like(row)
    row_bits, column_bits = rows.bit_length() - 1, columns.bit_length() - 1
    for level in range(levels):
        if level % 2 == 0:
            column_bits -= 1
            bit = column >> column_bits & 1
        else:
            row_bits -= 1
            bit = row >> row_bits & 1
        index = 2 * index + bit
    return index


class MemberTrees:
    """Binary trees that map the unit square to members, such as triangles, at scattered positions: nearby points lead
    to nearby members. Each node divides its members in half, along the two axes alternately.

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
        Depth of all trees.
    leaves : (trees, 2**depth) ndarray
        Number of the member in each leaf; 0 if empty.
    """

    def __init__(self, position: np.ndarray, tree: np.ndarray, trees: int) -> None:
        count = len(tree)
        self.depth = max(1, int(np.bincount(tree).max() - 1).bit_length())
        ranks = np.argsort(np.argsort(position, axis=0), axis=0)
        node = np.ones(count, dtype=np.int64)
        for level in range(self.depth):
            # Members of each node of this level, sorted along an axis, are halved.
            group = (tree << level) + node - (1 << level)
            order = np.argsort(group * count + ranks[:, level % 2])
            size = np.bincount(group, minlength=trees << level)
            rank = np.empty_like(node)
            rank[order] = np.arange(count) - (np.cumsum(size) - size)[group[order]]
            node = 2 * node + (rank >= size[group] // 2)
        self._leaf = (tree << self.depth) + node - (1 << self.depth)
        self.leaves = np.zeros((trees, 1 << self.depth), np.uint32)
        self.leaves.ravel()[self._leaf] = np.arange(count)

    def splits(self, weight: np.ndarray) -> np.ndarray:
        """Splits (trees, 2**depth) of the trees for M members with weights ``weight`` (M,), at least 0. A split is the
        fraction of a node's weight in its left subtree.
        """
        splits, below = np.ones(self.leaves.shape, np.float32), np.zeros(self.leaves.shape)
        below.ravel()[self._leaf] = weight
        for level in reversed(range(self.depth)):
            lower = below[:, 0::2]
            below = lower + below[:, 1::2]
            splits[:, 1 << level : 2 << level] = np.divide(lower, below, out=np.ones_like(lower), where=below > 0)
        return splits

    def boxes(self, splits: np.ndarray) -> np.ndarray:
        """The rectangle of the unit square that a tree with given ``splits`` maps to each of M members: lower corner
        and size (M, 4).
        """
        low, size = np.zeros((2, len(splits), 1)), np.ones((2, len(splits), 1))
        for level in range(self.depth):
            axis, split = level % 2, splits[:, 1 << level : 2 << level].astype(float)
            low, size = np.repeat(low, 2, axis=2), np.repeat(size, 2, axis=2)
            low[axis, :, 1::2] += split * size[axis, :, 1::2]
            size[axis, :, 0::2] *= split
            size[axis, :, 1::2] *= 1 - split
        return np.concatenate([low, size]).reshape(4, -1).T[self._leaf]
