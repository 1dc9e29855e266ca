"""Stated errors of figures that need no pad, counted on made-up truth."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from scipy import stats

from mitsuba_taxel.evidence.intervals.intervals import (
    ALLOWED,
    TWICE,
    IntervalCase,
    IntervalRow,
    interval_cases,
    named_below,
    summary,
)

ALARM = 1e-4
"""Chance that a case fails although its errors hold within the allowed lack."""


@pytest.mark.parametrize("case", [
    "stairs, noise white, 2", "stairs, noise hidden by steps", "ramp, noise correlated by 0.5",
    "mixture, noise white", "sine, noise as large as steps",
])  # fmt: skip
def test_stated_errors_of_recordings_hold(case):
    """Max slopes of stairs were off by any amount, as of noise below a step; correlated noise was taken for white.

    Few recordings tell this; the page below counts 200 of each case.
    """
    (one,) = interval_cases(case)
    count = 20 if "10" not in case else 10
    rows = replace(one, count=count).measured()
    _check(rows, least_stated=0.8)
    assert {row.figure for row in rows} == {
        "max_slope", "mean_slope", "zero_slope", "relative_slope", "nonlinearity", "hysteresis", "repeatability",
    }  # fmt: skip


@pytest.mark.parametrize("case", [
    "fit: exact model", "fit: exact model, errors by", "fit: correlated unknowns", "fit: true value near",
    "fit: model with errors of light", "elements prop", "elements in a random", "both errors",
])  # fmt: skip
def test_intervals_of_fits_hold(case):
    """Without the model's own errors, intervals of the last four held 10 to 33 % of the softness."""
    _check(replace(interval_cases(case)[0], count=80).measured())


@pytest.mark.parametrize("case", ["export: errors of", "export: errors common", "force: analogue", "force: steps"])
def test_errors_of_exported_models_and_noise_as_a_force_hold(case):
    """Of each seed several numbers are counted, here as one by their root mean square: at most 1.3 of a normal one."""
    (one,) = interval_cases(case)
    (row,) = replace(one, count=40).measured()
    assert row.within > TWICE - 2 * ALLOWED and row.ratio < 1.3 and not row.unstated


def _check(rows, least_stated=1.0):
    for row in rows:
        least = stats.binom.ppf(ALARM / len(rows), row.made, TWICE - ALLOWED)
        assert row.within * row.made >= least and row.made >= least_stated * (row.made + row.unstated), row


def test_shares_are_counted():
    case = IntervalCase("made", lambda seed: {"a": [0.0, 1.0, -3.0, float("nan")][seed % 4], "b": 1.0}, 40)
    first, second = case.measured()
    assert (first.made, first.unstated, first.within, second.within) == (30, 10, pytest.approx(2 / 3), 1.0)
    assert first.ratio == pytest.approx((10 / 3) ** 0.5)
    assert summary([first, second]).startswith("For 1 of 2 results, at least 92.5%")


def test_figures_below_are_named():
    """Of 200 errors at most 184 are within with the sum of the binomial probabilities."""
    rows = [IntervalRow("record: ramp", name, 200, 0, within, 1.0) for name, within in (("a", 0.925), ("b", 0.92))]
    chance = sum(math.comb(200, n) * TWICE**n * (1 - TWICE) ** (200 - n) for n in range(185))
    said = f"By chance, {100 * chance:.1f} such results are expected if the true coverage is 95.4 %."
    assert named_below([rows[0]] * 99 + rows[1:]) == f"Results with less: b of ramp (92.0%). {said}" and "2.1" in said
    assert named_below(rows[:1]).startswith("No result has less.")


def test_the_page_holds_errors_that_hold():
    """95 % of its figures within 3 points of the nominal share, or above; with 200 seeds they spread by 1.5 points."""
    text = (Path(__file__).parents[3] / "docs" / "coverage.md").read_text().split("## Results that need no pad")[1]
    text = text.split("## Probabilities")[0]
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")][2:]
    shares = [float(row[4].rstrip("%")) / 100 for row in rows]
    assert {row[0] for row in rows} == {case.name for case in interval_cases()}
    assert sum(share >= TWICE - ALLOWED for share in shares) >= 0.95 * len(shares) and min(shares) > 0.88
