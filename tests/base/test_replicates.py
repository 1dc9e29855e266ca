"""Estimates from independent replicates."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.replicates import largest_scatter_share, standard_error


@pytest.mark.parametrize("axis", [0, 1, -1])
def test_four_replicates(axis):
    """Of 1, 2, 3, 4 the variance is 5 / 3."""
    replicates = np.moveaxis(np.array([[1.0, 2.0, 3.0, 4.0], [10.0, 20.0, 30.0, 40.0]]).T, 0, axis)
    assert standard_error(replicates, axis) == pytest.approx(np.sqrt(5 / 12) * np.array([1, 10]), rel=1e-14)


def test_equal_replicates_have_exactly_none():
    assert standard_error(np.full((32, 2), 0.1)).tolist() == [0, 0]


def test_one_replicate_tells_nothing():
    assert np.isnan(standard_error(np.ones((1, 3)))).all()


@pytest.mark.parametrize("axis", [0, 1])
def test_one_of_all_replicates_has_all_but_one_nth_of_the_scatter(axis):
    """Of 0, ..., 0, 1 the squares of deviations are (1 - 1/n)² once, and 1/n² in the n - 1 other cases."""
    replicates = np.zeros((32, 2))
    replicates[7, 0], replicates[:, 1] = 1.0, 0.1
    assert largest_scatter_share(np.moveaxis(replicates, 0, axis), axis) == pytest.approx([31 / 32, 0.0], rel=1e-12)


def test_normal_replicates_rarely_have_half_of_the_scatter_in_one():
    """Of t with n - 2 degrees of freedom, 32 times P(|t| > 5.6) = 1.2e-4; of rare large values, half of all sets."""
    rng = np.random.default_rng(3)
    normal = largest_scatter_share(rng.normal(size=(32, 40_000)))
    rare = largest_scatter_share(rng.normal(size=(32, 1000)) + 20 * rng.binomial(1, 0.02, (32, 1000)))
    assert 0 < (normal > 0.5).sum() < 20  # 4.7 expected
    assert np.mean(rare > 0.5) > 0.3
