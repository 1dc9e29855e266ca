"""Equal pairs of numbers, as numpy finds them by sorting; memory of the pattern."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.elements.sparsity import Sparsity, equal_pairs
from mitsuba_taxel.mechanics.materials.laws import NeoHookean
from mitsuba_taxel.mechanics.materials.moduli import PAIRS
from mitsuba_taxel.mechanics.meshes import pad_mesh
from mitsuba_taxel.pads.parametric.pad import Pad


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
    rows, columns = sparsity.degrees_of_freedom()
    assert rows.dtype == columns.dtype == np.int32 and len(rows) == len(columns) == sparsity.entries
    ones = np.ones((2, len(PAIRS[0]), 9)), np.ones((2, 4, 30)), np.ones((2, 4, 4))
    assert np.all(sparsity.summed(*ones) == 1)  # no two elements share a pair of nodes
    assert rows.max() == 3 * count + 7 and columns[: 9 * 55].min() == 0

    # A matrix added to the block of two nodes arrives at their degrees of freedom.
    entries = np.zeros(sparsity.entries)
    sparsity.add_blocks(entries, nodes[:1, :2], np.ones((1, 6, 6)))
    assert set(rows[entries > 0] // 3) == {99_990, 99_991}


def test_a_solid_keeps_little_memory_for_each_element():
    """Elements keep the gradients of ten shape functions at eight points once, 1920 bytes, and sums keep 5 bytes for
    each of 111 entries; with a second copy and wider factors it was three times as much."""
    mesh = pad_mesh(Pad("cylindrical", rows=1, columns=1), 1.25)
    elements_of, count = len(mesh.tets), len(mesh.points)
    tracemalloc.start()
    try:
        elements = Elements(mesh, NeoHookean())
        kept_by_elements = tracemalloc.get_traced_memory()[0]
        sparsity = Sparsity(elements.nodes, elements.corners, count)
        kept_by_sums = tracemalloc.get_traced_memory()[0] - kept_by_elements
    finally:
        tracemalloc.stop()
    assert elements.gradients.nbytes == 1920 * elements_of
    assert kept_by_elements < 2300 * elements_of
    assert kept_by_sums < 1100 * elements_of
    assert sparsity.entries > 0
