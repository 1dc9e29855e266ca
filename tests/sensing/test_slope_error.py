"""Errors of derivatives by the finite elements, against derivatives whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import Pad, PadSensor, PhotoReflector
from mitsuba_taxel.mechanics.errors.second_state import SecondState
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.derivatives.slope_error import Comparison, mechanics_errors, unknown

SHEARED_BOX = -37e-6
"""W/N by fx at 1.2222 N: with elements of 0.1 mm along the edges of the roof, the layer at them 0.02 mm thick, and
patches that are cut twice and three times there, it is -38.3e-6 and -36.8e-6."""


def told(ratio):
    """By a mesh whose elements are larger by a factor."""
    return SecondState(None, 1 / abs(ratio**2 - 1), 1 / (ratio**2 + 1), 0.0)


def compared(smooth, kinks, ratio):
    """A derivative that is off by ``smooth`` and ``kinks`` on one mesh, and by ``ratio`` squared as much on another."""
    total = np.array([smooth + kinks])
    change = (ratio**2 - 1) * total
    return Comparison(np.append(0.0, change), np.zeros(1), np.array([(ratio**2 + 1) * kinks]), np.zeros(1))


@pytest.mark.parametrize("ratio", [0.6, 1.3, 2.0])
@pytest.mark.parametrize(("smooth", "kinks"), [(1.0, 0.0), (0.0, 1.0), (-1.0, 1.0), (0.5, 2.0)])
def test_errors_that_cancel_are_told_apart(ratio, smooth, kinks):
    """With -1 and 1, the derivatives on both meshes agree by chance."""
    errors, _ = mechanics_errors([compared(smooth, kinks, ratio)], np.ones((1, 1)), told(ratio))
    assert errors == pytest.approx(np.hypot(smooth, kinks))


def test_kinks_are_those_of_each_taxel_and_the_rest_is_averaged():
    against = [compared(1.0, 0.0, 2.0), compared(-3.0, 2.0, 2.0), compared(0.0, 0.0, 2.0)]
    errors, of_reading = mechanics_errors(against, np.array([[1.0], [1.0], [0.0]]), told(2.0))
    averaged = np.sqrt((1 + 9) / 2)  # of the cells that receive light
    np.testing.assert_allclose(errors[:2, 0], [averaged, np.hypot(averaged, 2.0)])
    assert np.all(of_reading == 0)


def test_without_a_second_mesh_errors_are_unknown():
    errors, of_reading = mechanics_errors([unknown(2)], np.ones((1, 1)), None)
    assert errors.shape == (1, 2) and np.isnan(errors).all() and np.isnan(of_reading).all()


def test_the_slope_of_a_sheared_box_is_off_by_less_than_twice_its_error():
    sensor = PadSensor(
        pad=Pad("parallelepiped", rows=1, columns=1),
        photo_reflector=PhotoReflector(rows=1, columns=1),
        force=(1.2222, 0, -0.8889),
    )
    scene = sensor.scene()
    found = derivatives_by([rates(scene, "fx")], scene.load(), of_light_alone=True)
    off = abs(found.values[0, 0] - SHEARED_BOX)
    assert 0.05 * abs(SHEARED_BOX) < off < 2 * found.standard_errors[0, 0] < 0.3 * abs(SHEARED_BOX)
