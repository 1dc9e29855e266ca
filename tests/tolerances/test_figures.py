"""Figures of readings whose dependence on force is known, and their derivatives."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mitsuba_taxel import Circuit
from mitsuba_taxel.tolerances.figures import figure_rates, figures, loaded_taxel

FORCE = np.array([0.0, -2.0])


def readings(gain, softness):
    """Two taxels; the second one changes most."""
    return gain * np.array([[4.0, 2.0], [4.0 * (1 + 0.1 * softness), 2.0 * (1 + 0.5 * softness**2)]])


def test_closed_forms():
    one = readings(3.0, 1.0)
    loaded = loaded_taxel(one, FORCE)
    found = figures(one, FORCE, loaded)
    assert loaded == 1
    np.testing.assert_allclose(found["rest"], [12, 6])
    np.testing.assert_allclose(found["sensitivity"], [-0.6, -1.5])
    np.testing.assert_allclose(found["crosstalk"], [0.2, np.nan])
    both = figures(np.stack([one, readings(5.0, 2.0)]), FORCE, loaded)
    np.testing.assert_allclose(both["crosstalk"][:, 0], [0.2, 0.1])


def test_of_one_reading_there_is_rest_alone():
    assert list(figures(np.ones((7, 1, 3)), FORCE[:1], 0)) == ["rest"]
    assert list(figures(np.ones((7, 2, 1)), FORCE, None)) == ["rest", "sensitivity"]


VOLT_PER_WATT = Circuit(supply=20.0, load_resistance=1.0, transfer=1.0, saturation_voltage=0.0, other_noise=0.1)
"""Up to 20 V."""


def test_behind_a_linear_circuit():
    """Half a volt per watt: all but the cross-talk is halved, and the noise is a force, that at rest over the slope."""
    one = readings(3.0, 1.0)
    circuit = dataclasses.replace(VOLT_PER_WATT, load_resistance=0.5, adc_bits=24)
    watts, volts = figures(one, FORCE, 1), figures(one, FORCE, 1, circuit)
    for name in ("rest", "sensitivity"):
        np.testing.assert_allclose(volts[name], watts[name] / 2, rtol=1e-12)
    np.testing.assert_allclose(volts["crosstalk"], watts["crosstalk"])
    np.testing.assert_allclose(volts["noise_force"], 0.1 / np.array([0.3, 0.75]), rtol=1e-6)
    rates = figure_rates(one, (one / 3.0)[..., None], FORCE, 1, circuit)
    np.testing.assert_allclose(rates["noise_force"][:, 0], -1 / 3.0 * volts["noise_force"], rtol=1e-6)
    np.testing.assert_allclose(rates["rest"][:, 0], volts["rest"] / 3, rtol=1e-6)


def test_saturation_of_light_that_is_linear_in_the_force():
    """One taxel saturates on the way; by the gain, F = -(20 / gain - r) / s with readings gain (r - s F)."""
    one = readings(4.6, 1.0)
    found = figures(one, FORCE, 1, VOLT_PER_WATT)
    np.testing.assert_allclose(found["saturation_force"], [-(20 / 4.6 - 4) / 0.2, np.nan])
    assert found["sensitivity"][0] == pytest.approx((20 - 18.4) / -2)
    rates = figure_rates(one, (one / 4.6)[..., None], FORCE, 1, VOLT_PER_WATT)
    np.testing.assert_allclose(rates["saturation_force"][:, 0], [20 / 4.6**2 / 0.2, np.nan], rtol=1e-4)
    bright = np.stack([one, 2 * one, 0.1 * one])
    np.testing.assert_allclose(figures(bright, FORCE, 1, VOLT_PER_WATT)["saturation_force"][1:, 0], [0, np.nan])


def test_a_converter_of_few_bits_adds_the_noise_of_its_steps():
    found = figures(readings(3.0, 1.0), FORCE, 1, dataclasses.replace(VOLT_PER_WATT, other_noise=0.0, adc_bits=2))
    np.testing.assert_allclose(found["noise_force"], 5 / np.sqrt(12) / np.array([0.6, 1.5]), rtol=1e-6)


def test_missing_readings_are_missing_behind_a_circuit():
    one = readings(3.0, 1.0)
    one[0, 1] = np.nan
    assert all(np.isnan(values[1]) for values in figures(one, FORCE, 0, VOLT_PER_WATT).values())


def test_derivatives():
    one, step = readings(3.0, 1.0), 1e-6
    by_gain = one / 3.0
    by_softness = (readings(3.0, 1 + step) - readings(3.0, 1 - step)) / (2 * step)
    unknown = np.full_like(one, np.nan)
    found = figure_rates(one, np.stack([by_gain, by_softness, unknown], axis=-1), FORCE, 1)
    np.testing.assert_allclose(found["sensitivity"][:, :2], [[-0.2, -0.6], [-0.5, -3.0]], rtol=1e-6)
    np.testing.assert_allclose(found["crosstalk"][0, :2], [0, 0.2 - 2 * 0.2], atol=1e-6)
    assert all(np.isnan(values[:, 2]).all() for values in found.values())


def test_without_any_derivative():
    found = figure_rates(readings(1.0, 1.0), np.full((2, 2, 1), np.nan), FORCE, 1)
    assert np.isnan(found["rest"]).all() and found["rest"].shape == (2, 1)


@pytest.mark.parametrize("value", [0.0, 1e-12])
def test_dark_taxels_do_not_count_as_loaded(value):
    assert loaded_taxel(np.array([[value * 0, 1.0], [1.0, 1.5]]), FORCE) == 1


def test_a_saturated_sensor_has_no_warning_and_no_minus_zero(recwarn):
    """It said `invalid value encountered in subtract`, and had the sensitivity -0."""
    circuit = Circuit(supply=3.3, load_resistance=22e3, transfer=8.0, adc_bits=12, adc_reference=0.5)
    power = readings(1e-3, 1.0)
    found = figures(power, FORCE, 1, circuit)
    assert np.isinf(found["noise_force"]).all() and not np.signbit(found["sensitivity"]).any()
    rates = figure_rates(power, np.ones((2, 2, 1)), FORCE, 1, circuit)
    assert np.isnan(rates["noise_force"]).all() and (rates["sensitivity"] == 0).all() and not len(recwarn)
