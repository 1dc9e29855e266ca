"""Where a circuit saturates, against closed forms: an ideal phototransistor, and light that is linear in the force."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.electronics import change_to_saturation, respond, saturating_power, saturation_force

pytestmark = pytest.mark.quick

FORCE = np.array([0.0, -1, -2, -4])


@pytest.mark.parametrize(
    ("numbers", "limit"),
    [
        ({}, 3.3),
        ({"buffer_gain": 5.0}, 3.3 / 5),
        ({"adc_reference": 1.2}, 1.2),
        ({"adc_reference": 1.2, "adc_bits": 1, "buffer_gain": 0.5}, 2.4),
    ],
)
def test_the_power_is_that_of_a_resistor_at_its_limit(circuit, numbers, limit):
    one = circuit(saturation_voltage=0.0, dark_current=1e-6, **numbers)
    assert saturating_power(one) == pytest.approx((limit / 22e3 - 1e-6) / 8, rel=1e-9)


def test_at_the_saturation_voltage_half_of_the_photocurrent_passes(circuit):
    assert saturating_power(circuit(saturation_voltage=0.4)) == pytest.approx(2 * (3.3 - 0.4) / 22e3 / 8, rel=1e-9)


@pytest.mark.parametrize(
    "numbers",
    [{"load_resistance": 0.0}, {"led_current": 0.0, "led_efficiency": 0.2}],
    ids=["no load", "no light"],
)
def test_what_never_saturates(circuit, numbers):
    one = circuit(**numbers)
    assert saturating_power(one) == math.inf
    assert np.isnan(saturation_force(one, FORCE, np.ones((4, 1)))).all()
    np.testing.assert_array_equal(change_to_saturation(one, [1.0], [[2.0, 0.0]]), math.inf)


def test_light_that_is_linear_in_the_force(circuit):
    """Rising, falling, beyond the limit at rest, never there; in any order, and of several sensors at once."""
    one = circuit()
    limit = saturating_power(one)
    rest, slope = limit * np.array([0.5, 2.0, 0.99, 0.1]), limit * np.array([0.2, -0.1, -0.1, 0.1])
    power = rest - slope * FORCE[:, None]
    expected = np.array([-2.5, 0.0, np.nan, np.nan])
    np.testing.assert_allclose(saturation_force(one, FORCE, power), expected, rtol=1e-12)
    np.testing.assert_allclose(saturation_force(one, FORCE[::-1], power[::-1]), expected, rtol=1e-12)
    both = saturation_force(one, FORCE, np.stack([power, 2 * power]))
    np.testing.assert_allclose(both, [expected, [0, 0, 0, -4]], rtol=1e-12)


@pytest.mark.parametrize(("gain", "where"), [(1.0, 0.25), (-1.0, -0.25), (0.1, np.nan)])
def test_a_run_through_zero_saturates_on_the_side_where_the_light_grows(circuit, gain, where):
    one, force = circuit(), np.array([-1.0, -0.5, 0.5, 1.0])
    power = saturating_power(one) * (0.75 + gain * force[:, None])
    np.testing.assert_allclose(saturation_force(one, force, power), [where], rtol=1e-12)


def test_a_run_that_is_beyond_the_limit_on_both_sides_of_zero_is_so_at_rest(circuit):
    one = circuit()
    power = 2 * saturating_power(one) * np.ones((2, 1))
    assert saturation_force(one, [-1, 2], power) == [0]


@pytest.mark.parametrize("share", [0.1, 0.9, 1.5])
def test_the_change_of_a_parameter_leads_to_the_limit(circuit, share):
    """However far the output is bent there already; by a positive and a negative derivative, and by none."""
    one = circuit(saturation_voltage=0.4)
    power = share * saturating_power(one)
    slopes = np.array([[3e-6, -2e-7, 0.0]])
    ((up, down, never),) = change_to_saturation(one, [power], slopes)
    if share > 1:
        assert (up, down, never) == (0, 0, 0)
    else:
        moved = power + slopes[0, :2] * (up, down)
        np.testing.assert_allclose(respond(one, moved).voltage, one.limit, rtol=1e-9)
        assert up > 0 > down and never == math.inf
