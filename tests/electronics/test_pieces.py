"""The response of a circuit in straight pieces is the response."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.electronics import respond
from mitsuba_taxel.electronics.pieces import straight_pieces

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("changed, pieces", [({}, 200), ({"saturation_voltage": 0.0, "buffer_gain": 2.0}, 40)])
@pytest.mark.parametrize("most", [1e-4, 1e-2])
def test_pieces_are_within_a_share_of_a_count(circuit, changed, pieces, most):
    one = circuit(dark_current=1e-6, **changed)
    power, voltage = straight_pieces(one, most)
    between = np.random.default_rng(0).uniform(0, most, 5000)
    off = np.interp(between, power, voltage) - respond(one, between).voltage
    assert np.abs(off).max() < 0.05 * one.step and 3 < len(power) < pieces


def test_what_is_straight_is_one_piece(circuit):
    assert len(straight_pieces(circuit(), 1e-5)[0]) == 2
    power, voltage = straight_pieces(circuit(load_resistance=math.inf), 1e-5)  # full from the first light
    assert voltage[0] == 0 and voltage[1:] == pytest.approx(3.3, rel=1e-9) and power[1] < 1e-13
