"""What a mirror sends back, against refraction ray by ray, against the renderer, and against datasheets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel import InputError, Scene, measure
from mitsuba_taxel.parts import edge_positions, mirror_curve, mirror_rays, read_part

VCNT = read_part("vcnt2020")


def refracted(part, height, rays, seed):
    """Mean of a random sample of rays from the emitter's die by Snell's and Fresnel's laws, and its standard error."""
    random, n = np.random.default_rng(seed), part.resin_index
    emitter, detector = part.emitter, part.detector
    place = (random.random((rays, 2)) - 0.5) * (emitter.die_width, emitter.die_length) + (emitter.x, emitter.y)
    turn, sine = 2 * np.pi * random.random(rays), np.sqrt(random.random(rays))  # Lambertian in the resin
    heading = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    free = n * sine < 1  # the others are reflected at the window
    outside = np.minimum(n * sine, 1 - 1e-12)
    within = sine / np.sqrt(1 - sine**2)
    out = place + emitter.die_depth * within[:, None] * heading
    back = out + 2 * height * (outside / np.sqrt(1 - outside**2))[:, None] * heading
    end = back + detector.die_depth * within[:, None] * heading
    cosines = np.sqrt(1 - outside**2), np.sqrt(1 - sine**2)
    amplitudes = [(a - b) / (a + b) for a, b in ((cosines[0], n * cosines[1]), (n * cosines[0], cosines[1]))]
    passed = (1 - np.mean(np.square(amplitudes), axis=0)) ** 2
    hit = np.all(
        np.abs(end - (detector.x, detector.y)) < np.array([detector.die_width, detector.die_length]) / 2, axis=1
    )
    power = passed * hit * free * in_window(emitter, out) * in_window(detector, back)
    return power.mean(), power.std() / np.sqrt(rays)


def in_window(side, places):
    """Whether places lie in an obround window: a rectangle and two discs."""
    x, y = np.abs(places - (side.x, side.window_y)).T
    radius, straight = side.window_width / 2, side.window_length / 2 - side.window_width / 2
    return ((x < radius) & (y < straight)) | (x**2 + (y - straight) ** 2 < radius**2)


@pytest.mark.parametrize(("height", "depth"), [(0.25, 0.1), (0.6, 0.4), (2.0, 0.1)])
def test_it_is_what_refraction_ray_by_ray_gives(agree, height, depth):
    part = replace(VCNT, **{name: replace(getattr(VCNT, name), die_depth=depth) for name in ("emitter", "detector")})
    value, error = refracted(part, height, 1_000_000, seed=int(100 * height))
    (power,) = mirror_curve(part, height)
    agree(power, 2e-3 * power, value, error, replicates=10_000)


def test_bare_dies_are_what_the_renderer_gives(agree):
    bare = {
        "window_width": 9.0,
        "window_length": 9.0,
        "die_depth": 0.0,
        "y": 0.0,
        "window_y": None,
        "window_shape": "rectangle",
    }
    emitter = replace(VCNT.emitter, x=-0.45, die_width=0.25, die_length=0.25, **bare)
    detector = replace(VCNT.detector, x=0.45, die_width=0.52, die_length=0.3, **bare)
    part = replace(VCNT, resin_index=1.0, emitter=emitter, detector=detector)
    scene = Scene.from_file("plate.xml", z=0.7, width=40, depth=40, law="lambertian", hole=0)
    readings = measure(scene, points=4096, seed=3)
    (power,) = mirror_curve(part, 0.7)
    agree(readings.power, readings.standard_error, power, 2e-3 * power)


def test_the_datasheet_of_the_vcnt2020():
    """All 13 points within 3 % of the peak."""
    heights, given = np.array(VCNT.distance_curve).T
    around = mirror_curve(VCNT, np.linspace(0.4, 0.7, 16))
    model = mirror_curve(VCNT, heights) / around.max()
    assert len(heights) == 13 and np.abs(model - given).max() < 0.03


def test_the_njl5908ar_is_brightest_where_its_datasheet_says():
    heights = np.linspace(0.2, 0.45, 26)
    assert heights[mirror_curve(read_part("njl5908ar"), heights).argmax()] == pytest.approx(0.30, abs=0.03)


def test_far_away_it_falls_as_the_square_of_the_height():
    near, far = mirror_curve(VCNT, [50, 100])
    assert near / far == pytest.approx(4, rel=1e-2)


def test_rays_meet_the_mirror_between_the_windows():
    rays = mirror_rays(VCNT, 0.55)
    centre = rays.power @ rays.places / rays.power.sum()
    assert centre == pytest.approx([0, -0.3], abs=0.03)


@pytest.mark.parametrize("height", [0.0, -1.0, float("nan")])
def test_no_height(height):
    with pytest.raises(InputError, match="height = "):
        mirror_rays(VCNT, height)


def test_the_edge_of_a_mirror_cuts_the_light_between_the_dies():
    small = replace(
        VCNT, **{n: replace(getattr(VCNT, n), die_width=1e-3, die_length=1e-3) for n in ("emitter", "detector")}
    )
    for axis, middle in enumerate((0.0, -0.3)):
        np.testing.assert_allclose(edge_positions(small, 1.0, axis), middle, atol=1e-3)
        low, half, high = edge_positions(VCNT, 1.0, axis)
        assert half == pytest.approx(middle, abs=5e-3) and 0.15 < high - low < 0.25
    rays = mirror_rays(VCNT, 0.5)
    beyond = rays.places[:, 0] < edge_positions(VCNT, 0.5, 0, 0.25)
    assert rays.power[beyond].sum() == pytest.approx(0.25 * rays.power.sum(), rel=1e-3)
    with pytest.raises(InputError, match="between 0 and 1"):
        edge_positions(VCNT, 1.0, 0, 1.0)
