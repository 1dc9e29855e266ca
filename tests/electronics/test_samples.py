"""Samples of a circuit's output: their mean, their noise, and their counts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mitsuba_taxel.electronics import respond, total_noise
from mitsuba_taxel.electronics.samples import sampled

pytestmark = pytest.mark.quick

ALARM = 1e-4
"""Chance that a statistical check fails although all is well."""


def test_samples_spread_by_the_noise_and_counts_by_that_of_the_converter_too(circuit):
    one = circuit(adc_bits=16, other_noise=4e-4)
    power, count = np.array([1e-6, 8e-6]), 4000
    voltage, counts = sampled(one, np.tile(power, (count, 1)), np.random.default_rng(3))
    right, noise = respond(one, power).voltage, total_noise(one, power)
    z = (voltage - right) / noise  # the converter's share of it is 6e-4 here
    assert stats.kstest(z.ravel(), "norm").pvalue > ALARM
    np.testing.assert_array_equal(counts, np.floor(voltage / one.step))
    squares = np.square(((counts + 0.5) * one.step - right) / noise).sum(axis=0)
    assert (np.abs(squares - count) < stats.norm.isf(ALARM / 4) * np.sqrt(2 * count)).all()


@pytest.mark.parametrize("power", [np.nan, -1e-7])
def test_light_that_is_missing_or_negative_is_dark(circuit, power):
    voltage, counts = sampled(circuit(bandwidth=1e-9), np.array([power]), np.random.default_rng(0))
    assert abs(voltage[0]) < 1e-9 and counts[0] == 0


def test_noise_adds_before_the_converter_and_the_full_scale_cuts_after_it(circuit):
    """At the full scale half of all samples are cut off; at twice as much all of them are, whatever the noise."""
    one = circuit(adc_reference=0.5, other_noise=0.05)
    voltage, counts = sampled(one, np.tile([0.5, 1.0] / np.array(22e3 * 8), (4000, 1)), np.random.default_rng(1))
    full = (counts == 4095).sum(axis=0)
    assert abs(full[0] - 2000) < stats.norm.isf(ALARM / 2) * np.sqrt(1000) and full[1] == 4000
    assert voltage[:, 1].mean() == pytest.approx(1.0, abs=0.01)
