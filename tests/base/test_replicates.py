"""Estimates from independent replicates."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.replicates import standard_error


@pytest.mark.parametrize("axis", [0, 1, -1])
def test_four_replicates(axis):
    """Of 1, 2, 3, 4 the variance is 5 / 3."""
    replicates = np.moveaxis(np.array([[1.0, 2.0, 3.0, 4.0], [10.0, 20.0, 30.0, 40.0]]).T, 0, axis)
    assert standard_error(replicates, axis) == pytest.approx(np.sqrt(5 / 12) * np.array([1, 10]), rel=1e-14)


def test_equal_replicates_have_exactly_none():
    assert standard_error(np.full((32, 2), 0.1)).tolist() == [0, 0]


def test_one_replicate_tells_nothing():
    assert np.isnan(standard_error(np.ones((1, 3)))).all()
