"""Grazing light, narrow and wide cones, little light: as quadratures say that share no code with the program."""

from __future__ import annotations

import numpy as np
import pytest
from plate_reference import image_power, plate_power
from plate_scenes import column, plate

from mitsuba_taxel import measure


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic"])
@pytest.mark.parametrize("law", ["lambertian", "uniform_solid_angle", "uniform_polar_angle"])
def test_grazing_light_matches_quadrature(llvm_mono, agree, law, scattering):
    """A plate 0.3 mm high, 2.5 to 6.5 mm aside: light comes to it at 83 to 88 degrees, and leaves it at 80 to 88."""
    reading = measure(plate(z=0.3, law=law, scattering=scattering, offset=4.5), points=1 << 17, seed=3)
    assert reading.relative_error < 5e-3
    agree(reading.power, reading.standard_error, plate_power(0.3, law, scattering, offset=4.5))


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic"])
@pytest.mark.parametrize("law", ["uniform_solid_angle", "uniform_polar_angle"])
@pytest.mark.parametrize("cone_angle", [1.0, 90.0])
def test_narrow_and_wide_cones_match_quadrature(llvm_mono, agree, law, scattering, cone_angle):
    heights = (0.1, 0.7)
    scenes = [plate(z=z, law=law, scattering=scattering, cone_angle=cone_angle) for z in heights]
    readings = [measure(scene, points=1 << 13, seed=4) for scene in scenes]
    assert max(r.relative_error for r in readings) < 2e-3
    agree(*column(readings), [plate_power(z, law, scattering, cone_angle) for z in heights])


@pytest.mark.parametrize("law", ["uniform_solid_angle", "uniform_polar_angle"])
def test_narrow_cones_in_a_mirror_match_images(llvm_mono, agree, law):
    """A cone of 1 degree comes back beside the phototransistor, and on it once its place is 20 mm higher."""
    assert measure(plate(z=0.7, law=law, scattering="mirror", cone_angle=1.0), points=1 << 10).power[0] == 0
    reading = measure(plate(z=20.0, law=law, scattering="mirror", cone_angle=1.0), points=1 << 14, seed=5)
    agree(reading.power, reading.standard_error, image_power(20.0, law, cone_angle=1.0))


def test_little_light_has_the_same_relative_error(llvm_mono, agree):
    """1e-9 W and less: from an LED of that power the very same replicates, and from a plate 5 m away quadrature."""
    bright, dim = (measure(plate(scattering="lambertian", power=power), points=1024, seed=6) for power in (1.0, 1e-9))
    assert np.allclose(dim.replicates, 1e-9 * bright.replicates, rtol=1e-5)
    assert dim.relative_error == pytest.approx(bright.relative_error, rel=1e-3)
    far = measure(plate(z=5000.0, scattering="lambertian", width=4000.0), points=1024, seed=7)
    assert far.power[0] < 1e-8 and far.relative_error < 5e-3
    agree(far.power, far.standard_error, plate_power(5000.0, "uniform_solid_angle", "lambertian", side=4000.0))


def test_an_led_without_power_gives_nothing(llvm_mono):
    for integrator in ("taxel_tracer", "taxel_path", "analog_tracer"):
        reading = measure(plate(scattering="lambertian", power=0.0, integrator={"type": integrator}), points=256)
        assert np.array_equal(reading.replicates, np.zeros((32, 1)))
        assert "no light found on taxel 1" in reading.notes
