"""Readings of cells with a profile: those of the paper's cells of revolution that they equal."""

from __future__ import annotations

import pytest

from mitsuba_taxel import Pad, PadSensor, Scene, measure
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


@pytest.mark.parametrize(("force", "error"), [((0.0, 0.0, 0.0), 1e-4), ((0.2, 0.0, -1.0), MESH)], ids=["rest", "load"])
def test_box_shaped_cells_are_profiles_of_a_square_section(force, error):
    """But for the patches of the light, which are others."""
    pad = Pad("parallelepiped", 1, 1)
    assert reading(pad.as_profile(), force) == pytest.approx(reading(pad, force), rel=error)


def test_light_in_a_pyramid_is_that_of_random_paths():
    """Within 4 standard errors: a false alarm in 16000 runs."""
    pad = Pad("profile", 1, 1, profile="1 0.6; 0.7 0.95; 0 1", section="square")
    live = Scene(PadSensor(pad).scene().source, mesh_size=1.5).load()
    (found,) = deterministic_light(live, False).power
    readings = measure(live, points=4096, mechanics_error=False)
    assert abs(readings.power[0] - found) < 4 * readings.standard_error[0] + 1e-4 * found
    assert readings.standard_error[0] < 3e-3 * found
