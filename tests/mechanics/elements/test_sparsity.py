"""Equal pairs of numbers, as numpy finds them by sorting."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.mechanics.elements.sparsity import equal_pairs


@pytest.mark.parametrize(("count", "size"), [(0, 3), (1, 1), (4000, 40)])
def test_equal_pairs_are_those_of_equal_keys(count, size):
    first, second = np.random.default_rng(count).integers(0, size, (2, count))
    rows, columns, target = equal_pairs(first, second, size)
    keys, number = np.unique(first * size + second, return_inverse=True)
    np.testing.assert_array_equal(rows * size + columns, keys)
    np.testing.assert_array_equal(target, number)
