"""Whatever numbers a circuit may have: its response is finite, rises with the light and ends at the supply."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mitsuba_taxel import Circuit, InputError
from mitsuba_taxel.electronics import power_at, respond, total_noise

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
@settings(max_examples=300, deadline=None, derandomize=True)
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
