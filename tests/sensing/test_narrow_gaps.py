"""Plates that nearly touch, or do, and the quadrature that says what they send back.

References are :func:`plate_power` and :func:`image_power`, deterministic quadratures that share no code with the
program.
"""

from __future__ import annotations

import numpy as np
import pytest
from plate_reference import plate_power
from plate_scenes import column, plate

from mitsuba_taxel import measure


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic"])
@pytest.mark.parametrize("law", ["lambertian", "uniform_solid_angle"])
def test_narrow_gaps_match_quadrature(llvm_mono, agree, law, scattering):
    """Plates 0.1 and 0.02 mm above the LED's plane."""
    heights = (0.1, 0.02)
    readings = [measure(plate(z=z, law=law, scattering=scattering), points=1 << 15, seed=1) for z in heights]
    reference = [plate_power(z, law, scattering) for z in heights]
    assert max(r.relative_error for r in readings) < 2e-3
    agree(*column(readings), reference)


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic", "mirror"])
def test_a_plate_that_touches_lets_nothing_across(llvm_mono, scattering):
    touching = measure(plate(z=0.0, scattering=scattering), points=1 << 12, seed=2)
    assert np.array_equal(touching.replicates, np.zeros((32, 1)))
    assert touching.notes[-1].startswith("no light found on taxel 1: it may receive ")


@pytest.mark.parametrize("scattering, order", [("lambertian", 2), ("isotropic", 1)])
def test_a_plate_that_all_but_touches_lets_little_across(llvm_mono, scattering, order):
    """A gap of 1e-5 mm: to a percent what quadrature says of 1e-3 mm, as light in a narrow gap goes with z**order."""
    reading = measure(plate(z=1e-5, scattering=scattering), points=1 << 12, seed=2)
    limit = plate_power(1e-3, "uniform_solid_angle", scattering) * 1e-2**order
    assert limit < 2e-6 and reading.power[0] == pytest.approx(limit, rel=0.01)
    assert reading.relative_error < 1e-2
    mirrored = measure(plate(z=1e-5, scattering="mirror"), points=1 << 12, seed=2)
    assert mirrored.power[0] == 0 and 0 < mirrored.standard_error[0] < 1e-4


@pytest.mark.parametrize(
    "law, z, cone_angle",
    [
        ("lambertian", 0.02, 88.0),
        ("uniform_solid_angle", 0.02, 88.0),
        ("uniform_solid_angle", 0.7, 1.0),
        ("uniform_polar_angle", 0.3, 88.0),
        ("uniform_polar_angle", 0.7, 1.0),
    ],
)
def test_the_quadrature_has_converged(law, z, cone_angle):
    """Finer panels, with half as many nodes again in each integral, change less than any reading here could show."""
    for scattering in ("lambertian", "isotropic"):
        finer = plate_power(z, law, scattering, cone_angle, fineness=1.0, nodes=24)
        assert plate_power(z, law, scattering, cone_angle) == pytest.approx(finer, rel=1e-6)


def test_the_quadrature_gives_known_powers():
    """Eight digits that were computed otherwise, with 88-degree cone and with Lambert's law."""
    assert plate_power(0.7, "lambertian", "lambertian") == pytest.approx(0.019702463, rel=1e-7)
    assert plate_power(0.7, "lambertian", "isotropic") == pytest.approx(0.013124617, rel=1e-7)
    assert plate_power(2.0, "uniform_solid_angle", "lambertian") == pytest.approx(0.0020717984, rel=1e-7)
    assert plate_power(1.05, "uniform_solid_angle", "isotropic") == pytest.approx(0.0047395992, rel=1e-7)
