"""Distinct rows beside numpy's, which sorts rows as wholes."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.unique_rows import unique_rows

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("shape", [(0, 3), (1, 2), (500, 2), (500, 6)])
def test_they_are_those_of_numpy(shape):
    rows = np.random.default_rng(1).integers(-2, 3, shape)
    _, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    found = unique_rows(rows)
    np.testing.assert_array_equal(found[0], first)
    np.testing.assert_array_equal(found[1], number.ravel())
