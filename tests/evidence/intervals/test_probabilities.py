"""Stated probabilities of a comparison, counted on made-up truth."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.evidence.intervals.comparisons import comparison_cases, probability_cases
from mitsuba_taxel.evidence.intervals.probabilities import ProbabilityCase, ProbabilityRow, pooled, summary


@pytest.mark.parametrize("name", ["relative_slope, errors of elements", "nonlinearity, errors of light"])
def test_probabilities_to_be_first_and_within_a_limit_come_true(name):
    """The number that came true deviates from the sum of probabilities by a normal error; beyond four of its standard
    deviations in one of 16 000 runs. Those between 20 and 80 %, which say the most, are counted alone."""
    outcomes = probability_cases()[f"compare: {name}"]
    drawn = [outcomes(seed) for seed in range(8)]
    for figure in ("first", "allowed"):
        stated, true = (np.concatenate(column) for column in zip(*(each[figure] for each in drawn), strict=True))
        assert len(stated) == len(true) == 24
        for some in (stated >= 0, (stated > 0.2) & (stated < 0.8)):
            p = stated[some]
            assert abs(true[some].sum() - p.sum()) < 4 * np.sqrt(np.sum(p * (1 - p)) + 1)


def test_a_difference_of_variants_is_counted():
    """Its error is not that of two independent readings: variants share most of theirs."""
    deviation = comparison_cases()["compare: relative_slope, errors of elements"]
    values = np.array([deviation(seed)["behind"] for seed in range(8)])
    assert 0.2 < np.sqrt(np.mean(values**2)) < 2  # chi-square of 8: beyond in less than one of 1000 runs


def test_ranges_are_counted():
    case = ProbabilityCase("made", lambda seed: {"first": (np.array([0.1, 0.9]), np.array([False, seed % 10 > 0]))}, 50)
    low, high = case.measured()
    assert (low.stated, low.made, low.true) == ("2 to 20 %", 50, 0.0) and (high.mean, high.true) == (0.9, 0.9)
    assert low.noise == pytest.approx(np.sqrt(0.1 * 0.9 / 50)) and low.holds and high.holds
    assert not ProbabilityRow("made", "first", "60 to 80 %", 100, 0.7, 0.5, 0.045).holds
    together = pooled([low, high, low, ProbabilityRow("other", "first", "80 to 98 %", 150, 0.8, 0.85, 0.03)])
    assert [row.stated for row in together] == ["2 to 20 %", "80 to 98 %"] and together[1].made == 200
    assert (together[1].mean, together[1].true) == pytest.approx((0.825, 0.8625))
    assert together[0].noise == pytest.approx(np.sqrt(0.1 * 0.9 / 100))
    assert summary([low, high]).startswith("In 2 of 2 ranges of probabilities, the observed")
