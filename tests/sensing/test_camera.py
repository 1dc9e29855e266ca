"""Images of cameras behind blocks, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import OpenEXR
import pytest
from camera_scene import DEPTH, DISTANCE, FIELD, HEIGHT, PIXELS, REFLECTANCE, SIDE, WIDTH, led, scene

from mitsuba_taxel import InputError
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.camera import camera_image
from mitsuba_taxel.sensing.image_file import write_image

import mitsuba as mi  # isort: skip

PARTS = 5
"""Number of places along each side of a pixel over which the closed form is averaged."""


def places():
    """x and y (H, W) in mm of the coat at the centres of pixels; x runs from right to left, y from top to bottom."""
    width, height = PIXELS
    size = FIELD / width
    return np.meshgrid(-size * (np.arange(width) + 0.5 - width / 2), -size * (np.arange(height) + 0.5 - height / 2))


@pytest.mark.parametrize(("place", "tilt"), [((0.0, 0.0, -3.0), 0.0), ((6.0, -4.0, -2.0), -35.0)])
def test_a_coat_has_the_radiance_that_a_small_lambertian_led_gives_it(llvm_mono, place, tilt):
    image = camera_image(scene(led(*place, tilt)), samples=64)
    x, y = places()
    x, y, z = x - place[0], y - place[1], HEIGHT - place[2]
    squared = x**2 + y**2 + z**2
    emission = np.maximum(math.sin(math.radians(tilt)) * x + math.cos(math.radians(tilt)) * z, 0) / np.sqrt(squared)
    irradiance = 3.0 * SIDE**2 * emission * z / np.sqrt(squared) / squared
    # Pixels at the border of the coat see it in part, and those around the LED see its dark back.
    inside = (np.abs(places()[0]) < WIDTH / 2 - 0.5) & (np.abs(places()[1]) < DEPTH / 2 - 0.5) & (emission > 0.1)
    hidden = DISTANCE / (place[2] - HEIGHT + DISTANCE) * np.array(place[:2])
    inside &= np.hypot(places()[0] - hidden[0], places()[1] - hidden[1]) > 1.5
    deviation = image.radiance[..., 0] - REFLECTANCE / math.pi * irradiance
    allowed = 0.005 * irradiance * REFLECTANCE / math.pi + 5 * image.standard_error[..., 0]
    assert inside.sum() > 300 and (np.abs(deviation) < allowed)[inside].all()
    assert deviation[inside].sum() == pytest.approx(0, abs=0.002 * image.radiance[..., 0][inside].sum())


def test_the_stated_error_is_that_of_repeated_images(llvm_mono):
    live = scene(led(0.0, 0.0, -3.0)).load()
    first, second = (camera_image(live, samples=2, seed=seed) for seed in (1, 2))
    error = np.hypot(first.standard_error, second.standard_error)[first.coat]
    ratio = (first.radiance - second.radiance)[first.coat][error > 0] / error[error > 0]
    assert 0.9 < np.sqrt(np.square(ratio).mean()) < 1.25  # of 16 replicates: t, with a standard deviation of 1.07
    assert np.array_equal(camera_image(live, samples=2, seed=1).radiance, first.radiance)


def test_a_coat_above_a_central_led_has_a_symmetric_image_with_all_its_light(llvm_mono):
    image = camera_image(scene(led(0.0, 0.0, -3.0)), samples=64)
    for axis in (0, 1):
        difference = image.radiance - np.flip(image.radiance, axis)
        error = np.hypot(image.standard_error, np.flip(image.standard_error, axis))
        assert (np.abs(difference) <= 6 * error + 1e-12).all()
    # View factor of a small area and a parallel rectangle above its corner (J. R. Howell, catalogue, B-3), four times.
    a, b = 0.5 * WIDTH / (HEIGHT + 3), 0.5 * DEPTH / (HEIGHT + 3)
    p, q = math.hypot(1, a), math.hypot(1, b)
    fraction = 4 * (a / p * math.atan(b / p) + b / q * math.atan(a / q)) / (2 * math.pi)
    light = image.radiance.sum() * (FIELD / PIXELS[0]) ** 2
    assert light == pytest.approx(REFLECTANCE * 3.0 * SIDE**2 * fraction, rel=2e-3)


def test_depth_is_that_of_the_coat_also_behind_a_clear_plate(llvm_mono):
    image = camera_image(scene(led(0.0, 0.0, -3.0)), samples=1)
    assert image.depth[image.coat] == pytest.approx(DISTANCE, rel=1e-5)
    assert np.isnan(image.depth[~image.coat]).all()
    assert image.coat.mean() == pytest.approx(WIDTH * DEPTH / (FIELD**2 * 0.75), abs=0.02)
    slab = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([0, 0, -4]).scale([15, 15, 1])}
    slab["bsdf"] = {"type": "dielectric", "int_ior": 1.49}
    behind = camera_image(scene(led(0.0, 0.0, -1.0), slab=slab), samples=1)
    assert behind.depth[behind.coat] == pytest.approx(DISTANCE, rel=1e-5)
    # Refraction shifts the coat closer by d (1 - 1 / n).
    larger = (1 - 2 * (1 - 1 / 1.49) / DISTANCE) ** -2
    assert behind.coat.sum() == pytest.approx(larger * image.coat.sum(), rel=0.03)


def test_an_image_is_written_with_its_errors_and_its_depth(llvm_mono, tmp_path):
    image = camera_image(scene(led(0.0, 0.0, -3.0)), samples=1)
    picture = write_image(image, tmp_path / "image.exr")
    with OpenEXR.File(str(tmp_path / "image.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    of_pixels = {"Y", "standard_error.Y", "mechanics_error.Y", "depth", "coat"}
    assert set(channels) == of_pixels | {f"displacement.{a}" for a in "xyz"}
    assert np.array_equal(channels["Y"], image.radiance[..., 0].astype(np.float32))
    assert np.array_equal(channels["depth"], image.depth.astype(np.float32), equal_nan=True)
    assert np.array(mi.Bitmap(str(picture))).max() == 255


def test_a_target_error_is_reached(llvm_mono):
    image = camera_image(scene(led(0.0, 0.0, -3.0), pixels=(12, 9)), target_error=0.004)
    assert image.relative_error <= 0.004


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"target": (0, 0, -40)}, "the camera sees nothing of the pad"),
        ({"bottom": {"type": "diffuse"}}, "the camera does not see the coat"),
        ({"origin": (0, 0, 30)}, "the camera does not see the coat"),
        ({"top": {"type": "diffuse"}}, "the coat reflects nothing to the inside"),
        ({"pixels": (2_000_000, 2_000_000)}, "width = 2000000, height = 2000000 of the film are not allowed"),
        ({"integrator": {"type": "taxel_tracer"}}, "integrator taxel_tracer reads phototransistors"),
        ({"second": {"type": "perspective"}}, "the scene holds 2 cameras"),
    ],
)
def test_scenes_without_an_image_are_refused_in_one_line(llvm_mono, changes, message):
    with pytest.raises(InputError, match=message) as refused:
        camera_image(scene(led(0.0, 0.0, -3.0), **changes), samples=1)
    assert "\n" not in str(refused.value)


def test_a_film_larger_than_memory_is_refused_before_the_pad_is_deformed(llvm_mono, monkeypatch):
    monkeypatch.setattr(Scene, "load", lambda self: pytest.fail("the scene was built"))
    with pytest.raises(InputError, match="width = 2000000, height = 30000 of the film are not allowed"):
        camera_image(scene(led(0.0, 0.0, -3.0), pixels=(2_000_000, 30_000)), samples=1)


@pytest.mark.parametrize("opaque", ["window", "back"])
def test_a_coat_that_no_light_reaches_is_refused(llvm_mono, opaque):
    dark = {"outer": {"type": "diffuse"}} if opaque == "window" else {}
    # A light beside the block with opaque sides; or one that is turned away from the coat.
    light = led(14.0, 0.0, 2.0, -90.0) if opaque == "window" else led(6.0, 0.0, -3.0, 180.0)
    with pytest.raises(InputError, match="no light reaches the coat, of 16 paths from each pixel") as refused:
        camera_image(scene(light, **dark), samples=1)
    assert "\n" not in str(refused.value)


def test_a_scene_without_light_or_with_wrong_numbers_is_refused(llvm_mono):
    with pytest.raises(InputError, match="the scene holds no light"):
        camera_image(scene(), samples=1)
    for wrong in ({"samples": 0}, {"samples": 1, "target_error": 0.1}, {"target_error": 2.0}, {"seed": -1}):
        with pytest.raises(InputError):
            camera_image(scene(led(0.0, 0.0, -3.0)), **wrong)


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
