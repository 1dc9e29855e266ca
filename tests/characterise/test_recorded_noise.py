"""Samples that carry the errors of a converter's steps."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.characterise import replicates
from mitsuba_taxel.characterise.recorded import recorded_noise
from mitsuba_taxel.characterise.recorded.recorded_noise import PointErrors, with_errors
from mitsuba_taxel.characterise.replicates import at_largest

POINTS, CHANNELS, REPLICATES = 25, 900, 64


def deviations_of_the_largest():
    """Of the largest of 24 equal differences of points, each rounded to steps, over its scatter (CHANNELS,)."""
    random = np.random.default_rng(3)
    true = random.uniform(8, 12, size=CHANNELS) * np.arange(POINTS)[:, None]
    value = true + random.uniform(-0.5, 0.5, size=true.shape)
    of_steps, nothing = np.full(true.shape, 1 / np.sqrt(12)), np.zeros(CHANNELS)
    errors = PointErrors([0 * true], [of_steps], nothing, nothing + 1, nothing == 0)
    (samples,) = with_errors([value], errors, REPLICATES)
    np.testing.assert_allclose(samples.mean(axis=1), value)
    np.testing.assert_allclose(samples.std(axis=1, ddof=1) / np.sqrt(REPLICATES), of_steps, rtol=1e-9)
    return at_largest(np.diff(samples, axis=0)).value - np.diff(true, axis=0)[0]


def test_the_largest_of_rounded_differences_has_no_bias():
    """Two-sided at 3.3 standard errors, missed by chance once in 1000."""
    found = deviations_of_the_largest()
    assert abs(found.mean()) < 3.3 * found.std() / np.sqrt(CHANNELS)


def test_deviations_with_tails_that_steps_do_not_have_make_it_small(monkeypatch):
    """As they did: 5 to 10 % of slopes of stairs, where the half that chooses is not smoothed."""
    monkeypatch.setattr(replicates, "FEWEST_SMOOTH", POINTS)
    monkeypatch.setattr(recorded_noise, "_bounded", recorded_noise._deviations)
    found = deviations_of_the_largest()
    assert found.mean() < -3.3 * found.std() / np.sqrt(CHANNELS)


@pytest.mark.parametrize("count", [16, 64])
def test_bounded_deviations_are_unit_vectors_without_mean_whose_halves_are_uniform(count):
    drawn = recorded_noise._bounded(count, 2000, np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), 1)
    np.testing.assert_allclose(drawn.sum(axis=1), 0, atol=1e-12)
    half = np.sqrt(count * (count - 1)) * drawn[:, ::2].mean(axis=1)
    assert half.max() < np.sqrt(3) < 1.01 * half.max() and np.std(half) == pytest.approx(1, abs=0.05)
