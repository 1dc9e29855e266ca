"""Light in a cell with a flat roof, against closed forms and against each other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.evidence.domes.flat_roof_light import FlatRoof
from mitsuba_taxel.evidence.domes.sphere_light import CONE, DEPTH, WIDTH


def test_far_away_light_falls_with_the_fourth_power_of_the_height():
    """From a small roof: intensity / h^2 onto its area, and a lambertian wall's 1 / (pi h^2) onto the detector's."""
    height, radius = 100.0, 0.5
    area, detector = math.pi * radius**2, WIDTH * DEPTH
    power = area * detector / (2 * math.pi * (1 - math.cos(CONE)) * math.pi * height**4)
    assert FlatRoof(radius, height, 0.6).diffuse_power("lambertian") == pytest.approx(power, rel=1e-3)
    assert FlatRoof(radius, height, 0.6).diffuse_power("isotropic") == pytest.approx(power / 2, rel=1e-3)


def test_a_large_roof_lights_as_an_infinite_one():
    """Quadrature points converge, and a roof twice as large changes the power by what its border sends."""
    small, large, finer = (
        FlatRoof(r, 1.0, 0.6).diffuse_power("isotropic", n) for r, n in ((6, 36), (12, 36), (12, 72))
    )
    assert large == pytest.approx(finer, rel=1e-6) and 0 < large - small < 1e-2 * large


def test_rays_on_a_nearly_smooth_mirror_are_those_of_the_image():
    """Within 4.5 standard errors of 16 runs: one false alarm in some 2000 runs."""
    roof = FlatRoof(0.75, 1.05, 0.6)
    (image, none), (power, error) = roof.mirror_power(), roof.mirror_power(1e-4, seed=3, points=1 << 13)
    assert none == 0 and 0 < error < 0.05 * power and abs(power - image) < 4.5 * error


def test_a_mirror_hides_what_a_small_disc_does_not_show():
    """Rays between LED and detector meet the mirror half-way: the disc is small beside their middles at 0."""
    whole, hidden = FlatRoof(5.0, 1.0, 0.6).mirror_power()[0], FlatRoof(0.01, 1.0, 0.6).mirror_power()[0]
    assert 0 <= hidden < 0.1 * whole
    distances = 2.0 + 0 * np.linspace(0, 1)
    assert whole < WIDTH * DEPTH / (2 * math.pi * (1 - math.cos(CONE))) / distances.min() ** 2
