"""The error told by two meshes, if half of its square is random from mesh to mesh."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.convergence import scattered_share


@pytest.mark.parametrize("order", [1.5, 2.0])
@pytest.mark.parametrize("ratio", [0.5, 1.2, 1.45, 2.0])
def test_it_is_right_on_average_over_meshes_whose_errors_are_half_random(ratio, order):
    """Errors h^p (c + s) on both meshes, c and s independent and of equal variance; s is another one on each mesh."""
    count = 100_000
    regular, here, there = np.random.default_rng(1).standard_normal((3, count))
    error = regular + here
    difference = ratio**order * (regular + there) - error
    stated = (scattered_share(ratio, order) * difference) ** 2
    off = stated - error**2
    assert abs(off.mean()) < 4 * off.std() / np.sqrt(count)


def test_it_goes_over_into_that_of_a_regular_error_on_much_larger_elements():
    assert scattered_share(10.0, 2.0) == pytest.approx(1 / (10.0**2 - 1), rel=0.01)
