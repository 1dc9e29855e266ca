"""The response against closed forms, at its ends, against its own inverse, and of whatever circuits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitsuba_taxel import Circuit, InputError
from mitsuba_taxel.electronics import power_at, respond, total_noise
from mitsuba_taxel.electronics.response import counts_of

pytestmark = pytest.mark.quick

POWERS = np.concatenate([[0.0], np.logspace(-12, 9, 64)])


def test_a_load_resistor_far_from_saturation(circuit):
    light = np.array([0.0, 1e-9, 1e-6, 1e-5])
    shown = respond(circuit(saturation_voltage=0.05, dark_current=1e-9), light)
    np.testing.assert_allclose(shown.voltage, 22e3 * (8 * light + 1e-9), rtol=1e-12)
    np.testing.assert_allclose(shown.rate, 22e3 * 8, rtol=1e-12)


def test_an_ideal_phototransistor_is_cut_off_at_the_supply(circuit):
    shown = respond(circuit(saturation_voltage=0.0), POWERS)
    np.testing.assert_allclose(shown.voltage, np.minimum(22e3 * 8 * POWERS, 3.3), rtol=1e-12)
    np.testing.assert_allclose(shown.rate, np.where(22e3 * 8 * POWERS < 3.3, 22e3 * 8, 0.0), rtol=1e-12)


@pytest.mark.parametrize("half", [0.02, 0.1, 0.4, 2.0])
def test_half_of_the_photocurrent_passes_at_the_saturation_voltage(circuit, half):
    one = circuit(saturation_voltage=half)
    current = (3.3 - half) / 22e3
    shown = respond(one, 2 * current / 8)
    assert shown.voltage == pytest.approx(3.3 - half, rel=1e-12) and shown.passed == pytest.approx(0.5, rel=1e-10)


@pytest.mark.parametrize("half", [0.005, 0.1, 0.4])
@pytest.mark.parametrize("resistance", [1.0, 22e3, 1e9])
def test_the_inverse_and_the_slope(circuit, half, resistance):
    one = circuit(saturation_voltage=half, load_resistance=resistance, dark_current=1e-9, buffer_gain=0.5)
    shown = respond(one, POWERS)
    assert np.all(np.diff(shown.voltage) >= 0)
    assert np.all((shown.rate >= 0) & (shown.rate <= 0.5 * resistance * 8 * (1 + 1e-12)))
    back = power_at(one, shown.voltage)
    # What double precision leaves of a voltage, on either side.
    free = shown.rate > 0
    off = 4 * np.finfo(float).eps * (shown.voltage[free] / shown.rate[free] + POWERS[free] + 1e-9 / 8)
    assert np.all(np.abs(back - POWERS)[free] <= 4 * off)
    step = 1e-4 * shown.voltage[8:40]
    around = [power_at(one, shown.voltage[8:40] + sign * step) for sign in (1, -1)]
    inside = shown.voltage[8:40] + 40 * step < one.buffer_gain * one.supply
    difference = (2 * step / (around[0] - around[1]))[inside]
    np.testing.assert_allclose(shown.rate[8:40][inside], difference, rtol=2e-2)
    smooth = inside & (shown.voltage[8:40] < 0.9 * one.limit)
    np.testing.assert_allclose(shown.rate[8:40][smooth], difference[smooth[inside]], rtol=1e-4)


def test_no_load_and_no_connection(circuit):
    assert np.all(respond(circuit(load_resistance=0.0, dark_current=1e-9), POWERS).voltage == 0)
    open_emitter = respond(circuit(load_resistance=math.inf), POWERS)
    assert open_emitter.voltage[0] == 0 and np.all(open_emitter.voltage[1:] == 3.3)
    assert np.all(open_emitter.rate[1:] < 1e-6 / POWERS[1:])
    nearly = respond(circuit(load_resistance=1e18), POWERS[20:])
    np.testing.assert_allclose(nearly.voltage, 3.3, rtol=1e-6)


def test_the_buffer_ends_at_the_supply(circuit):
    shown = respond(circuit(buffer_gain=10.0), np.array([1e-6, 1e-5]))
    assert shown.voltage[0] == pytest.approx(1.76) and shown.voltage[1] == 3.3 and shown.rate[1] == 0


@pytest.mark.parametrize("bits", [1, 2, 12, 24])
def test_counts(circuit, bits):
    one, most = circuit(adc_bits=bits, adc_reference=3.0), 2**bits - 1
    edges = np.array([0.0, 0.5, 1.0, most - 0.5, most + 0.5]) * one.step
    np.testing.assert_array_equal(counts_of(one, edges), [0, 0, 1, most - 1, most])
    assert counts_of(one, 1e9) == most and respond(one, 1e3).counts == most


def test_nothing_is_read_beyond_the_full_scale(circuit):
    """0.5 V, reached at 0.5 / (22e3 * 8) W: the output goes on up to the supply, what is read of it does not."""
    one = circuit(adc_reference=0.5)
    edge = 0.5 / (22e3 * 8)
    shown = respond(one, edge * np.array([0.5, 0.999, 1.001, 2, 1e3]))
    np.testing.assert_allclose(shown.voltage, [0.25, 0.4995, 0.5, 0.5, 0.5], rtol=1e-6)
    np.testing.assert_allclose(shown.rate, [22e3 * 8, 22e3 * 8, 0, 0, 0], rtol=1e-6)
    assert shown.saturated.tolist() == [False, False, True, True, True] and (shown.counts[2:] == 4095).all()
    assert shown.output[3] == pytest.approx(1.0, rel=1e-3) and shown.output_rate[3] > 1e5


def test_dark_and_without_dark_current(circuit):
    assert respond(circuit(), 0.0).voltage == 0
    assert respond(circuit(led_current=0.0, led_efficiency=0.2, dark_current=1e-9), 1.0).voltage == pytest.approx(22e-6)


def test_negative_light_is_refused(circuit):
    with pytest.raises(InputError, match="power = -1e-06"):
        respond(circuit(), [1e-6, -1e-6])


def test_no_power_brings_what_no_power_can(circuit):
    assert np.all(np.isnan(power_at(circuit(), [-0.1, 3.3, 5.0]))) and power_at(circuit(dark_current=1e-6), 0.0) < 0


SIZES = st.sampled_from([1e-18, 1e-9, 1e-3, 0.5, 1.0, 25.0, 1e3, 1e9, 1e18])
CIRCUITS = st.fixed_dictionaries(
    {"supply": SIZES, "load_resistance": SIZES | st.sampled_from([0.0, math.inf]), "transfer": SIZES},
    optional={
        **dict.fromkeys(("saturation_voltage", "dark_current", "dark_decade", "buffer_gain", "adc_reference"), SIZES),
        **dict.fromkeys(("bandwidth", "current_gain", "flicker_noise", "flicker_from", "other_noise"), SIZES),
        "temperature": st.sampled_from([-200.0, 0.0, 500.0]),
        "adc_bits": st.sampled_from([1, 24]),
    },
)


@given(CIRCUITS)
@settings(max_examples=300)
def test_a_response_is_finite_and_rises(numbers):
    try:
        circuit = Circuit(**numbers)
    except InputError:
        return
    power = np.array([0, 1e-12, 1e-6, 1e-3, 1, 1e3])
    shown = respond(circuit, power)
    assert np.all((shown.voltage >= 0) & (shown.voltage <= circuit.supply * (1 + 1e-12)))
    assert np.all(np.diff(shown.voltage) >= -1e-12 * circuit.supply)
    assert np.all(np.isfinite(shown.rate) & (shown.rate >= 0)) and np.all(np.diff(shown.counts) >= 0)
    assert np.all(np.isfinite(total_noise(circuit, power))) and power_at(circuit, shown.voltage).shape == power.shape
