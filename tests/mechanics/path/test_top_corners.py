"""Paths under a spread force end where the corners of the top do not bear it."""

from __future__ import annotations

import re

import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics import NeoHookean, PlateForce, SpreadForce, load_path
from mitsuba_taxel.mechanics.materials.corner_limit import corner_limit
from mitsuba_taxel.mechanics.path.natural_step import TICKS
from mitsuba_taxel.pads import Pad

FLAT = Pad(rows=1, columns=1, pitch=5.0, wall=2.0, height=1.5, cell_size=1.0, cell_height=0.4)
LAW = NeoHookean(1.0)
BEYOND = (0.0, 0.0, -6.4)
"""N, of which the corners of its top bear 5.9; at 6.8 it touches the board on coarse elements."""


@pytest.mark.parametrize("size", [2.0, 1.2])
def test_an_end_does_not_depend_on_the_elements_and_names_its_reason(size, mechanics_error_unknown):
    reason = r"corners of its top give way beyond 0\.236 MPa of constant direction, .*load = plate_force"
    with pytest.raises(ComputationError, match=reason) as end:
        load_path(FLAT, LAW, [BEYOND], load=SpreadForce(), mesh_size=size)
    force = float(re.search(r"force = \(0, 0, -([\d.]+)\) N", str(end.value))[1])
    bears = corner_limit(LAW) * FLAT.extent[0] * FLAT.extent[1]
    tick = 0.02 * LAW.youngs_modulus * FLAT.extent[0] * FLAT.extent[1] / TICKS
    assert bears - tick < force < bears


def test_a_plate_keeps_their_shape(mechanics_error_unknown):
    pytest.importorskip("ipctk")
    (state,) = load_path(FLAT, LAW, [BEYOND], load=PlateForce(self_contact=True), mesh_size=2.0)
    assert state.stability_checked
