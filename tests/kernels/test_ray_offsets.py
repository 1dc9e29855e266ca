"""Scenes in metres, far away, and 107 mm wide: as the same in place, and as quadratures say."""

from __future__ import annotations

import numpy as np
import pytest
from plate_reference import image_power, plate_power
from plate_scenes import column, moved, plate, soft_sensor

from mitsuba_taxel import Wall, measure


@pytest.mark.parametrize("z", [0.1, 0.7])
@pytest.mark.parametrize("scattering", ["isotropic", "mirror"])
def test_size_and_place_of_a_plate_do_not_matter(llvm_mono, agree, scattering, z):
    """100 times larger and smaller, in metres, and 200 mm away: as in place, and as quadrature says."""
    mi = llvm_mono
    transform = mi.ScalarTransform4f()
    motions = [transform.scale(scale) for scale in (1, 100, 0.01, 0.001)] + [transform.translate([200, -150, 120])]
    points = 1 << (14 if scattering == "mirror" else 12)
    readings = [measure(plate(z=z, scattering=scattering, motion=motion), points=points, seed=9) for motion in motions]
    power, error = column(readings)
    law = "uniform_solid_angle"
    reference = image_power(z, law) if scattering == "mirror" else plate_power(z, law, scattering)
    assert np.all(error < 2e-3 * power)
    assert np.all(np.abs(power / power[0] - 1) < 1e-3)  # the same random numbers
    agree(power, error, np.full(len(motions), reference))


def test_size_and_place_of_a_pad_do_not_matter(llvm_mono, agree, own_solutions):
    """A pad under a force with all that stands in it, in metres, 100 times larger, and 200 mm away."""
    transform = llvm_mono.ScalarTransform4f()
    motions = [transform, transform.scale(1e-3), transform.scale(100), transform.translate([200, -150, 120])]
    scene = soft_sensor(force=-1.0, roof=Wall("lambertian", 0.9), side=Wall("lambertian", 0.5)).scene().source
    readings = [measure(moved(scene, motion), points=1 << 12, seed=10, mechanics_error=False) for motion in motions]
    power, error = column(readings)
    assert np.all(error < 2e-3 * power)
    agree(power[1:], error[1:], np.full(3, power[0]), error[0])
    assert np.all(np.abs(power / power[0] - 1) < 2e-3)  # the same random numbers


def test_three_hundred_taxels_read_alike(llvm_mono, agree):
    """An array 107 mm wide under one plate: as one alone, and as quadrature says for a plate of that extent."""
    array = plate(z=0.3, law="lambertian", scattering="lambertian", width=140.0, rows=10, columns=30)
    single = plate(z=0.3, law="lambertian", scattering="lambertian", width=140.0)
    readings, alone = measure(array, points=256, seed=11), measure(single, points=1 << 13, seed=12)
    assert readings.power.shape == (300,) and readings.relative_error < 1e-2
    reference = plate_power(0.3, "lambertian", "lambertian", side=140.0)
    agree(alone.power, alone.standard_error, reference)
    agree(readings.power, readings.standard_error, np.full(300, reference))
