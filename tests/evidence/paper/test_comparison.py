"""Orders of shapes, and numbers with one common factor."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest, norm

from mitsuba_taxel.evidence.paper.comparison import common_scale, order, pairs_in_order


@pytest.mark.parametrize(("gap", "error"), [(1.0, 1.0), (0.3, 1.0), (3.0, 0.5)])
def test_two_values_are_in_order_as_often_as_their_difference_is_above_zero(gap, error):
    found = order({"a": 0.0, "b": gap}, {"a": error, "b": error})
    assert found.names == ("b", "a")
    assert found.certainty == pytest.approx(norm.cdf(gap / (error * 2**0.5)), abs=0.007)


def test_three_equal_values_have_each_order_once_in_six():
    assert order(dict.fromkeys("abc", 1.0), dict.fromkeys("abc", 0.1)).certainty == pytest.approx(1 / 6, abs=0.005)


def test_pairs_in_order():
    assert pairs_in_order({"a": 3, "b": 2, "c": 1}, {"a": 2, "b": 3, "c": 1, "d": 9}) == (2, 3)


def test_the_common_factor_is_found_and_its_chi_square_is_one():
    """Over many draws p is uniform, and the factor scatters by its stated error."""
    random = np.random.default_rng(3)
    expected, spread = np.array([1.0, 2.0, 3.0, 5.0]), np.array([0.02, 0.05, 0.03, 0.04])
    fits = [common_scale(7 * expected * np.exp(spread * random.normal(size=4)), expected, spread) for _ in range(500)]
    assert kstest([fit.p for fit in fits], "uniform").pvalue > 1e-3
    scores = np.array([(fit.scale - 7) / fit.scale_error for fit in fits])
    assert abs(scores.mean()) < 4 / np.sqrt(500)
    assert np.std(scores) == pytest.approx(1, abs=0.13)


def test_noise_that_goes_with_the_square_root_is_told_from_slopes():
    reading = np.array([0.004, 0.003, 0.006, 0.02])
    numbers = 3e-3 * np.sqrt(reading)
    spread = np.full(4, 0.1)
    root, straight = common_scale(numbers, np.sqrt(reading), spread), common_scale(numbers, reading, spread)
    assert root.misfit == pytest.approx(1) and root.p == pytest.approx(1)
    assert straight.p < 1e-6 and straight.misfit > 1.3
