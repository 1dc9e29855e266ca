"""Readings and studies as a circuit shows them: the chain rule, and what is missing."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.electronics import (
    in_volts,
    respond,
    saturated_words,
    saturating_power,
    shown,
    total_noise,
    with_volts,
)
from mitsuba_taxel.electronics.volts import VOLTS, circuit_of_study
from mitsuba_taxel.sensing import Readings
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives

pytestmark = pytest.mark.quick

POWER = np.array([[1e-6, 5e-6], [1.5e-5, 3e-5], [1e-4, np.nan]])


@pytest.fixture
def study():
    samples = POWER[:, None] * (1 + 1e-3 * np.linspace(-1, 1, 4)[:, None])
    dims = ("fz", "taxel")
    return xr.Dataset(
        {
            "power": (dims, POWER),
            "total_error": (dims, 0.01 * POWER),
            "replicate_power": (("fz", "replicate", "taxel"), samples, {"units": "W"}),
        },
        {"fz": [0.0, -1.0, -2.0], "taxel": [1, 2]},
    )


def test_a_study_beside_its_powers(circuit, study):
    one = circuit(dark_current=1e-9)
    told = with_volts(study, one)
    np.testing.assert_allclose(told.voltage.values[:2], respond(one, POWER[:2]).voltage)
    np.testing.assert_allclose(told.voltage_error.values[0], 0.01 * POWER[0] * 22e3 * 8, rtol=1e-9)
    np.testing.assert_allclose(told.noise.values[:2], total_noise(one, POWER[:2]))
    assert told.saturated.values[:, 0].tolist() == [0, 0, 1]
    for name in VOLTS:
        assert np.isnan(told[name].values[2, 1]) and np.isfinite(told[name].values[2, 0])
    assert circuit_of_study(told) == one and circuit_of_study(study) is None and with_volts(study, None) is study


def test_a_study_in_volts_has_the_voltage_of_its_mean_power(circuit, study):
    volts = in_volts(study, circuit())
    mean = volts.replicate_power.mean("replicate")
    np.testing.assert_allclose(mean.values[:2], respond(circuit(), POWER[:2]).voltage, rtol=1e-12)
    np.testing.assert_allclose(volts.total_error, with_volts(study, circuit()).voltage_error, rtol=1e-6)
    assert volts.replicate_power.attrs["units"] == "V" and volts.replicate_power.dims == study.replicate_power.dims
    assert np.isnan(mean.values[2, 1])


def test_derivatives_follow_the_chain_rule(circuit):
    """Of powers that go with the force as P0 + a F + b F^2, at a point where the phototransistor saturates."""
    one, force, step = circuit(), 2.0, 1e-6

    def power(at):
        return np.array([1e-5 + 3e-6 * at + 1e-7 * at**2, 1.5e-5 + 1e-6 * at])

    slope = np.array([[3e-6 + 2e-7 * force], [1e-6]])
    slopes, none = slope * [1, 2], 0 * power(force)
    derivatives = Derivatives(
        ("fz", "x"), ("W/N", "W"), slopes, 0.1 * slopes, power(force), none, 0.1, np.ones(2), 0.5, np.ones(2)
    )
    told = shown(one, Readings(np.tile(power(force), (32, 1)), 64, 0, derivatives=derivatives))
    ends = [respond(one, power(force + sign * step)).voltage for sign in (1, -1)]
    volts, counts, noise, margin = told.derivatives
    np.testing.assert_allclose(volts.values[:, 0], (ends[0] - ends[1]) / (2 * step), rtol=1e-5)
    assert volts.units == ("V/N", "V")
    np.testing.assert_allclose(volts.standard_errors, 0.1 * volts.values)
    np.testing.assert_allclose(counts, volts.values * 4096 / 3.3)
    np.testing.assert_allclose(noise * volts.values, np.tile(told.noise[:, None], 2))
    limit = saturating_power(one)
    np.testing.assert_allclose(margin, np.maximum(limit - power(force)[:, None], 0) / slopes)
    *_, last = told.derivatives.rows()
    assert (last["taxel"], last["parameter"], last["unit"]) == (2, "x", "V")
    assert (last["counts"], last["noise_equivalent"], last["to_saturation"]) == (
        counts[1, 1],
        noise[1, 1],
        margin[1, 1],
    )


def test_a_saturated_reading_is_named_and_has_no_derivative(circuit):
    """One taxel below a full scale of 0.5 V, one above; and a converter that is coarser than the noise."""
    one, none = circuit(adc_reference=0.5, bandwidth=1.0), np.zeros(2)
    power, slopes = np.array([1e-6, 5e-6]), np.full((2, 1), 1e-7)
    derivatives = Derivatives(("fz",), ("W/N",), slopes, 0.1 * slopes, power, none, 0.1, np.ones(2), 0.5, np.ones(1))
    told = shown(one, Readings(np.tile(power, (32, 1)), 64, 0, derivatives=derivatives))
    assert told.saturated.tolist() == [False, True] and told.columns["saturated"] is told.saturated
    assert told.derivatives.counts[1, 0] == 0 and np.isinf(told.derivatives.noise_equivalent[1, 0])
    assert [note.split(":")[0] for note in told.notes] == [
        "saturated",
        "The noise before the converter is less than half of its step of 0.0001221 V",
    ]
    assert shown(circuit(other_noise=0.01), Readings(np.tile(power, (32, 1)), 64, 0)).notes == []


def test_readings_that_saturate_are_counted_in_words(circuit):
    one = circuit(adc_reference=0.5)
    assert saturated_words(one, POWER) == (
        "the output is saturated (at 0.5 V or more) in 4 of 5 readings, most often of taxel 1: such "
        "readings depend little on the force, and not at all at the full scale"
    )
    assert saturated_words(one, 0.01 * POWER) == ""
