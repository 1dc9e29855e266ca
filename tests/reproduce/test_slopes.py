"""Sensitivities of noisy curves."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.reproduce.slopes import sensitivity, smooth

FORCE = np.arange(0, -20.5, -0.5)


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_a_polynomial_is_given_back(degree):
    curve = 1e-3 * np.polynomial.Legendre([1.0, *[0.2] * degree])(FORCE / 10 + 1)
    samples = curve[:, None, None] + 1e-9 * np.random.default_rng(1).normal(size=(41, 32, 2))
    smoothed, finer, found = smooth(FORCE, samples)
    assert found == degree
    assert np.abs(smoothed.mean(axis=1) - curve[:, None]).max() < 1e-9
    assert np.abs(finer - smoothed).max() < 1e-8


def test_the_maximum_slope_is_that_of_the_steepest_taxel(make_study):
    power = np.stack([0.01 + 1e-6 * FORCE**2, 0.01 + 2e-6 * FORCE**2], axis=1)
    found = sensitivity(make_study({"fz": FORCE}, power, 1e-7), "fz")
    assert (found.taxel, found.at, found.degree) == (2, -19.75, 2)
    assert found.max_slope == pytest.approx(2e-6 * (20**2 - 19.5**2) / 0.5, abs=5 * found.max_slope_error)
    assert found.mean_slope == pytest.approx(-2e-6 * 20, abs=5 * found.mean_slope_error)
    assert found.max_slope_error < 1e-7


@pytest.mark.parametrize("slope", [1e-5, -1e-5])
def test_noise_far_above_the_signal_does_not_make_a_slope(make_study, slope):
    """The largest raw step is many times the true slope; that of the smooth curves is right to its error."""
    power = np.repeat(0.02 + slope * FORCE[:, None], 9, axis=1)
    found = [sensitivity(make_study({"fz": FORCE}, power, 4e-4, seed), "fz") for seed in range(40)]
    scores = [(one.max_slope - abs(slope)) / one.max_slope_error for one in found]
    assert np.mean([one.raw_max_slope for one in found]) > 10 * abs(slope)
    assert abs(np.mean(scores)) < 4 / np.sqrt(40)  # false alarm once in 16 000
    assert 0.3 < np.std(scores) < 1.5  # below 1, as the errors also cover a curvature that the noise would hide


@pytest.mark.parametrize("curvature", [0.0, 1e-8, 3e-8, -6e-8, 6e-8, 1e-7, -1e-7, -3e-7])
@pytest.mark.parametrize("taxels", [1, 9])
def test_errors_cover_a_curvature_that_noise_hides(make_study, curvature, taxels):
    """Found in the noise or not. The errors of the light alone would be too small by up to 9."""
    power = np.repeat(0.02 + 1e-5 * FORCE[:, None] + curvature * FORCE[:, None] ** 2, taxels, axis=1)
    found = [sensitivity(make_study({"fz": FORCE}, power, 4e-5, seed), "fz") for seed in range(60)]
    largest = max(abs(1e-5 + 2 * curvature * force) for force in (-0.25, -19.75))
    scores = [(one.max_slope - largest) / one.max_slope_error for one in found]
    means = [(one.mean_slope - 1e-5 + 20 * curvature) / one.mean_slope_error for one in found]
    assert np.sqrt(np.mean(np.square(scores))) < 2
    assert np.sqrt(np.mean(np.square(means))) < 1.4
