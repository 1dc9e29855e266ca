"""Readings of cells with a profile: those of the paper's cells of revolution that they equal."""

from __future__ import annotations

import pytest

from mitsuba_taxel import Pad, PadSensor, Scene
from mitsuba_taxel.sensing.deterministic_light import deterministic_light

MESH = 1e-3
"""Relative change of a reading by another mesh of the same size."""


def reading(pad, force):
    (power,) = deterministic_light(Scene(PadSensor(pad, force=force).scene().source, mesh_size=1.5).load(), False).power
    return power


@pytest.mark.parametrize(("force", "error"), [((0.0, 0.0, 0.0), 2e-6), ((0.2, 0.0, -1.0), MESH)], ids=["rest", "load"])
@pytest.mark.parametrize("cell", ["cylindrical", "spherical", "hemispheric"])
def test_readings_are_those_of_the_same_cell(cell, force, error):
    pad = Pad(cell, 1, 1)
    assert reading(pad.as_profile(), force) == pytest.approx(reading(pad, force), rel=error)
