"""The largest of noisy numbers."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.characterise.replicates import at_largest


@pytest.mark.parametrize("spread", [0.0, 0.5, 2.0])
def test_the_largest_is_between_its_estimate_and_that_with_the_excess(spread):
    """Of 20 numbers that differ by less or more than their errors of 1: on average, within 4 standard errors."""
    random, channels = np.random.default_rng(1), 500
    true = spread * np.linspace(-1, 1, 20) + 10
    found = at_largest(true[:, None, None] + 4 * random.normal(size=(20, 16, channels)))
    low, high = found.value - true.max(), found.value + found.excess - true.max()
    assert low.mean() < 4 * low.std() / np.sqrt(channels) and high.mean() > -4 * high.std() / np.sqrt(channels)
    assert (found.excess >= 0).all() and at_largest(np.ones((3, 1, 2))).excess.tolist() == [0, 0]
