"""Lights of images: LEDs of this package, spot lights, and colours of LEDs, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from camera_scene import DEPTH, DISTANCE, FIELD, HEIGHT, PIXELS, REFLECTANCE, SIDE, WIDTH, scene

from mitsuba_taxel import InputError
from mitsuba_taxel.sensing.camera import camera_image
from mitsuba_taxel.sensing.led_colour import led_colour

import mitsuba as mi  # isort: skip

FWHM = 2 * math.sqrt(2 * math.log(2))


def coat():
    """x and y (H, W) in mm of the coat at the centres of pixels, and which pixels show the coat alone."""
    width, height = PIXELS
    size = FIELD / width
    x, y = np.meshgrid(-size * (np.arange(width) + 0.5 - width / 2), -size * (np.arange(height) + 0.5 - height / 2))
    return x, y, (np.abs(x) < WIDTH / 2 - 0.5) & (np.abs(y) < DEPTH / 2 - 0.5)


def check(image, irradiance, inside):
    """Compare the radiance of pixels with that of a Lambertian coat, to 0.5 % each and 0.2 % in the mean."""
    expected = REFLECTANCE / math.pi * irradiance
    deviation = image.radiance[..., 0] - expected
    assert inside.sum() > 250
    assert (np.abs(deviation) < 0.005 * expected + 5 * image.standard_error[..., 0])[inside].all()
    assert deviation[inside].sum() == pytest.approx(0, abs=0.002 * expected[inside].sum())


@pytest.mark.parametrize(("law", "power", "hole"), [("lambertian", 2.0, 0.0), ("uniform_solid_angle", 0.7, 0.12)])
def test_an_annular_led_gives_a_coat_its_power(llvm_mono, law, power, hole):
    x, y, inside = coat()
    led = {"type": "annular_led", "law": law, "power": power, "size": SIDE, "hole": hole}
    to_world = mi.ScalarTransform4f().translate([2.0, -1.0, -3.0]).scale([SIDE / 2, SIDE / 2, 1])
    image = camera_image(scene({"type": "rectangle", "to_world": to_world, "led": led}), samples=64)
    x, y, z = x - 2.0, y + 1.0, HEIGHT + 3.0
    squared = x**2 + y**2 + z**2
    cosine = z / np.sqrt(squared)
    # Power per solid angle: cosine / pi, or uniform in a cone of 88 degrees.
    intensity = cosine / math.pi if law == "lambertian" else 1 / (2 * math.pi * (1 - math.cos(math.radians(88))))
    hidden = DISTANCE / (DISTANCE - HEIGHT - 3.0) * np.array([2.0, -1.0])  # the dark back of the LED
    inside &= np.hypot(x + 2.0 - hidden[0], y - 1.0 - hidden[1]) > 1.5
    check(image, power * intensity * cosine / squared, inside)


def test_a_spot_light_gives_a_coat_its_intensity(llvm_mono):
    x, y, inside = coat()
    turned = mi.ScalarTransform4f().look_at([1.0, 0.5, -5.0], [1.0, 0.5, 4.0], [0, 1, 0])
    spot = {"type": "spot", "intensity": 4.0, "cutoff_angle": 40.0, "beam_width": 39.0, "to_world": turned}
    image = camera_image(scene(spot), samples=64)
    squared = (x - 1.0) ** 2 + (y - 0.5) ** 2 + 9.0**2
    cosine = 9.0 / np.sqrt(squared)
    inside &= cosine > math.cos(math.radians(36))
    check(image, 4.0 * cosine / squared, inside)
    dark = cosine < math.cos(math.radians(43))
    assert image.radiance[..., 0][dark].max() == 0


@pytest.mark.parametrize(("peak", "width"), [(625.0, 18.0), (525.0, 35.0), (465.0, 25.0)])
def test_colours_of_gaussian_leds_are_those_of_the_closed_form(peak, width):
    nm = np.arange(350.0, 751.0, 0.5)
    places, widths = np.array([600.0, 540.0, 460.0]), np.array([90.0, 80.0, 60.0])
    spectrum = np.stack([nm, 3.0 * np.exp(-0.5 * ((nm - peak) / (width / FWHM)) ** 2)], axis=1)
    # The camera's rows lie elsewhere, and less densely.
    rows = np.arange(351.2, 750.0, 0.7)
    pixels = np.exp(-0.5 * ((rows[:, None] - places) / (widths / FWHM)) ** 2)
    colour = led_colour(spectrum, np.column_stack([rows, 0.8 * pixels]))
    both = width**2 + widths**2
    expected = 0.8 * widths / np.sqrt(both) * np.exp(-0.5 * (peak - places) ** 2 / both * FWHM**2)
    np.testing.assert_allclose(colour, expected, rtol=2e-3, atol=1e-6)


def test_a_narrow_led_has_the_sensitivity_at_its_wavelength():
    camera = [[400, 0.0, 0.1, 0.9], [500, 0.2, 0.8, 0.3], [700, 0.6, 0.0, 0.0]]
    led = [[549.9, 0], [550, 5], [550.1, 0]]
    np.testing.assert_allclose(led_colour(led, camera), [0.3, 0.6, 0.225], rtol=1e-3)


@pytest.mark.parametrize(
    ("spectrum", "message"),
    [
        ([[600, 0.0], [620, 0.0]], "spectrum is not allowed: its power is 0"),
        ([[620, 1.0], [600, 1.0]], "spectrum is not allowed: rows of wavelength in nm, rising, and power are needed"),
        ([[600, 1.0], [620, -1.0]], "all finite and at least 0"),
        ([600, 620], "at least two"),
        ([["red", 1.0], [620, 1.0]], "spectrum is not allowed: rows of wavelength"),
        ([[600, 1.0], [820, 1.0]], "sensitivity is not allowed: its rows from 400 to 700 nm leave out 55% of the"),
    ],
)
def test_tables_that_give_no_colour_are_refused(spectrum, message):
    with pytest.raises(InputError, match=message):
        led_colour(spectrum, [[400, 0.1, 0.1, 0.9], [700, 0.6, 0.0, 0.0]])
