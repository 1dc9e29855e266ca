"""Noise against closed forms of the textbooks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from mitsuba_taxel.electronics import noise_parts, respond, total_noise
from mitsuba_taxel.electronics.circuit import BOLTZMANN, CHARGE

pytestmark = pytest.mark.quick

LIGHT = np.array([1e-8, 1e-6, 1e-5])


def test_shot_noise_of_a_current_on_a_resistor(circuit):
    for gain in (0.0, 300.0):
        shot = noise_parts(circuit(bandwidth=200.0, current_gain=gain), LIGHT)["shot"]
        expected = 22e3 * np.sqrt(2 * CHARGE * 8 * LIGHT * (1 + 2 * gain) * math.pi / 2 * 200)
        np.testing.assert_allclose(shot, expected, rtol=1e-9)


def test_thermal_noise_of_a_resistor_on_a_capacitor_is_that_of_the_capacitor(circuit):
    """k T / C, whatever R."""
    for resistance in (1e2, 1e4):
        one = circuit(load_resistance=resistance, bandwidth=1 / (2 * math.pi * resistance * 1e-9))
        thermal = noise_parts(one, 1e-9)["thermal"]
        assert thermal == pytest.approx(math.sqrt(BOLTZMANN * 298.15 / 1e-9), rel=1e-6)


def test_flicker_noise_through_the_low_pass(circuit):
    one = circuit(flicker_noise=1e-5, flicker_from=0.01, bandwidth=30.0)
    square, _ = quad(lambda log: 1e-10 / (1 + (math.exp(log) / 30) ** 2), math.log(0.01), math.log(1e6))
    assert noise_parts(one, 1e-6)["flicker"] == pytest.approx(math.sqrt(square), rel=1e-6)


@pytest.mark.parametrize("bits", [1, 12, 24])
def test_quantisation(circuit, bits):
    assert noise_parts(circuit(adc_bits=bits), 0.0)["quantisation"] == pytest.approx(3.3 / 2**bits / math.sqrt(12))


def test_the_parts_make_the_whole(circuit):
    one = circuit(other_noise=4e-4, flicker_noise=1e-5)
    parts = np.array(list(noise_parts(one, LIGHT).values()))
    np.testing.assert_allclose(total_noise(one, LIGHT), np.sqrt((parts**2).sum(axis=0)))


@pytest.mark.parametrize("resistance", [0.0, 22e3, math.inf])
def test_what_shows_no_light_shows_none_of_its_noise(circuit, resistance):
    """Dark, saturated, short-circuited and open: finite, and below that of the resistor in the open."""
    one = circuit(load_resistance=resistance)
    for light in (0.0, 1.0, 1e9):
        parts = noise_parts(one, light)
        assert all(math.isfinite(value) for value in parts.values())
        free = math.sqrt(4 * BOLTZMANN * 298.15 * 22e3 * math.pi / 2 * 1000)
        assert parts["thermal"] <= free * (1 + 1e-9)
        if light or resistance != 22e3:
            assert parts["shot"] < 1e-8 and respond(one, light).rate < 10
