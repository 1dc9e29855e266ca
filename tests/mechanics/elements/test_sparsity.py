"""Equal pairs of numbers, as numpy finds them by sorting."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.mechanics.elements.sparsity import Sparsity, equal_pairs
from mitsuba_taxel.mechanics.materials.moduli import PAIRS


@pytest.mark.parametrize(("count", "size"), [(0, 3), (1, 1), (4000, 40)])
def test_equal_pairs_are_those_of_equal_keys(count, size):
    first, second = np.random.default_rng(count).integers(0, size, (2, count))
    rows, columns, target = equal_pairs(first, second, size)
    keys, number = np.unique(first * size + second, return_inverse=True)
    np.testing.assert_array_equal(rows * size + columns, keys)
    np.testing.assert_array_equal(target, number)


def test_keys_of_many_nodes_do_not_overflow():
    """Numbers have 32 bits, their keys 64: those of 100 000 nodes exceed 32 bits."""
    nodes, count = np.array([[*range(99_990, 100_000)], [*range(10)]]), 100_000
    corners = np.array([[0, 1, 2, 3], [4, 5, 6, 7]])
    sparsity = Sparsity(nodes, corners, count)
    assert sparsity.rows.dtype == sparsity.columns.dtype == np.int32
    ones = np.ones((2, len(PAIRS[0]), 9)), np.ones((2, 4, 30)), np.ones((2, 4, 4))
    assert np.all(sparsity.summed(*ones) == 1)  # no two elements share a pair of nodes
    assert sparsity.rows.max() == 3 * count + 7 and sparsity.columns[: 9 * 55].min() == 0

    # A matrix added to the block of two nodes arrives at their degrees of freedom.
    entries = np.zeros(len(sparsity.rows))
    sparsity.add_blocks(entries, nodes[:1, :2], np.ones((1, 6, 6)))
    assert set(sparsity.rows[entries > 0] // 3) == {99_990, 99_991}
