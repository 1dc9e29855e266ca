"""Images through a window that refracts, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from camera_scene import DEPTH, DISTANCE, FIELD, HEIGHT, PIXELS, REFLECTANCE, SIDE, WIDTH, led, scene

from mitsuba_taxel.sensing.camera import camera_image

PARTS = 5
"""Number of places along each side of a pixel over which the closed form is averaged."""


def per_pixel(values):
    """Values at all places as an array (H, PARTS, W, PARTS)."""
    return values.reshape(PIXELS[1], PARTS, PIXELS[0], PARTS)


def transmittance(cosine, index):
    """Transmitted part of unpolarised light that enters a medium at a plane (Fresnel), and the cosine inside."""
    inside = np.sqrt(1 - (1 - cosine**2) / index**2)
    parallel = (index * cosine - inside) / (index * cosine + inside)
    perpendicular = (cosine - index * inside) / (cosine + index * inside)
    return 1 - 0.5 * (parallel**2 + perpendicular**2), inside


@pytest.mark.parametrize(("index", "place", "tilt"), [(1.41, (7.0, -4.5, 0.6), -20.0), (1.55, (-8.0, 5.0, 1.5), 0.0)])
def test_a_coat_behind_a_refracting_window_has_the_radiance_of_the_closed_form(llvm_mono, index, place, tilt):
    window = {"type": "dielectric", "int_ior": index, "ext_ior": 1.0}
    # Without the light that window and coat reflect to each other, which the closed form leaves out.
    path = {"type": "path", "max_depth": 3}
    image = camera_image(scene(led(*place, tilt), bottom=window, integrator=path), samples=64)

    # Where rays meet the window and, refracted, the coat, at PARTS x PARTS places of each pixel; x runs from right to
    # left.
    width, height = PARTS * PIXELS[0], PARTS * PIXELS[1]
    along = [-(FIELD / width) * (np.arange(n) + 0.5 - n / 2) / DISTANCE for n in (width, height)]
    slope_x, slope_y = np.meshgrid(*along)
    slope = np.hypot(slope_x, slope_y)
    passed, inside = transmittance(1 / np.sqrt(1 + slope**2), index)
    reach = (DISTANCE - HEIGHT) + HEIGHT * np.sqrt(1 - inside**2) / inside / slope
    x, y = slope_x * reach, slope_y * reach

    # A small Lambertian light in the same medium; radiance falls by the square of the index where it leaves.
    dx, dy, dz = x - place[0], y - place[1], HEIGHT - place[2]
    squared = dx**2 + dy**2 + dz**2
    turned = math.radians(tilt)
    emission = np.maximum(math.sin(turned) * dx + math.cos(turned) * dz, 0) / np.sqrt(squared)
    irradiance = 3.0 * SIDE**2 * emission * dz / np.sqrt(squared) / squared
    expected = per_pixel(passed / index**2 * REFLECTANCE / math.pi * irradiance).mean(axis=(1, 3))

    # Not at the border of the coat, nor where the light hides it or is too near to be a point.
    used = (np.abs(x) < WIDTH / 2 - 0.5) & (np.abs(y) < DEPTH / 2 - 0.5) & (emission > 0.1)
    used &= np.hypot(dx, dy) > 2.5
    used = per_pixel(used).all(axis=(1, 3))
    assert used.sum() > 300 and image.coat[used].all()
    assert image.depth[used] == pytest.approx(DISTANCE, rel=1e-5)
    deviation = image.radiance[..., 0] - expected
    assert (np.abs(deviation) < 0.005 * expected + 5 * image.standard_error[..., 0])[used].all()
    assert deviation[used].sum() == pytest.approx(0, abs=0.002 * expected[used].sum())
