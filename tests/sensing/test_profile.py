"""Readings of cells with a profile: those of the paper's cells of revolution that they equal."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import Pad, PadSensor, Scene, measure
from mitsuba_taxel.sensing.derivatives import derivatives_by
from mitsuba_taxel.sensing.deterministic_light import deterministic_light
from mitsuba_taxel.sensing.scene_rates import rates

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


def test_light_of_a_flat_isotropic_roof_has_a_kink():
    """Bent one way, its points see each other, in proportion to the bend: slopes are those of differences on either
    side, and differ. The derivative of the flat roof is between them."""
    step = 0.01
    places = 0.65 + step * np.arange(-2, 3)
    value, slope = [], []
    for place in places:
        pad = Pad("profile", 1, 1, cell_height=2.4, profile=f"1 0.65; 0.7 {place}; 0 0.65", section="square")
        moved = pad.moved_from(pad.changed(profile_z2=0.65))
        scene = Scene(PadSensor(moved).scene().source, mesh_size=1.6)
        found = derivatives_by([rates(scene, "profile_z2")], scene.load(), with_errors=False)
        value.append(found.power[0])
        slope.append(found.values[0, 0])
    for one, other in ((0, 1), (3, 4)):
        difference = (value[other] - value[one]) / step
        assert (slope[one] + slope[other]) / 2 == pytest.approx(difference, rel=0.01, abs=1e-5)
    below, above = np.diff(value)[[1, 2]] / step
    assert abs(below - above) > 0.5 * abs(below)
    assert min(below, above) < slope[2] < max(below, above)
