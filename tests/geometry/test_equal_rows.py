"""Equal rows of whole numbers are found as numpy finds them."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.equal_rows import distinct_rows


@pytest.mark.parametrize("shape, kinds", [((500, 3), 4), ((40, 1), 9), ((7, 2), 1), ((0, 2), 3)])
def test_groups_are_those_of_numpy(shape, kinds):
    rows = np.random.default_rng(1).integers(-kinds, kinds, shape)
    _, first, group = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    ours = distinct_rows(rows)
    np.testing.assert_array_equal(ours[0], first)
    np.testing.assert_array_equal(ours[1], group.ravel())
