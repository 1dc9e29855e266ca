"""What holds for every sensor, whatever its pad, its load, its walls and its photo-reflector."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from mitsuba_taxel import (
    AnnularLed,
    Pad,
    PadSensor,
    PhotoReflector,
    Phototransistor,
    Scene,
    Wall,
    energy_audit,
    measure,
)
from mitsuba_taxel.mechanics import NeoHookean, load_path
from mitsuba_taxel.pads import CELL_SHAPES, REGIONS

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

MESH_SIZE = 1.5
"""Of the finite elements, relative to the height of the pad: a coarse one, as the laws hold on any."""
EXAMPLES = 9
PADS, SEED = 6, 20240607
FALSE_ALARM_RATE = 1e-4
"""Chance that one test of all of its examples fails although all is well."""

few, fewer = (settings(max_examples=examples) for examples in (EXAMPLES, 2 * EXAMPLES // 3))


def number(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda value: round(value, 3))


@lru_cache
def random_pad(kind: int, rows: int) -> Pad:
    """One of a few random pads, which the examples share, as meshes take long; cells have room for a package."""
    random = np.random.default_rng([SEED, kind, rows])
    cell = CELL_SHAPES[kind % len(CELL_SHAPES)]
    size, top = random.uniform(2.2, 3.2), random.uniform(1.2, 1.8)
    return Pad(
        cell,
        rows=rows,
        columns=1,
        pitch=size + random.uniform(0.8, 1.5),
        wall=random.uniform(0.8, 1.5),
        height=(0.5 + 0.5 * size if cell == "hemispheric" else top) + random.uniform(1.0, 3.0),
        cell_size=size,
        cell_height=None if cell == "hemispheric" else top,
    )


walls = st.builds(
    Wall, scattering=st.sampled_from(["lambertian", "isotropic", "mirror"]), reflectance=number(0.3, 0.95)
)
leds = st.builds(
    AnnularLed,
    power=number(0.001, 2.0),
    size=number(0.15, 0.3),
    hole=number(0.0, 0.1),
    law=st.sampled_from(["uniform_solid_angle", "lambertian"]),
)
reflectors = st.builds(
    PhotoReflector,
    spacing=number(0.8, 0.9),
    led=leds,
    phototransistor=st.builds(Phototransistor, width=number(0.3, 0.5), depth=number(0.2, 0.6)),
    wall=st.builds(Wall, scattering=st.just("lambertian"), reflectance=number(0.0, 0.9)),
)


@st.composite
def sensors(draw, rows: int = 1, aside: float = 0.0) -> PadSensor:
    """Sensors that are pressed by a few percent, and pushed aside by up to a share ``aside`` of that force."""
    pad, modulus = random_pad(draw(st.integers(0, PADS - 1)), rows), draw(number(0.3, 8.0))
    width, depth, _ = pad.extent
    pressing = draw(number(0.002, 0.02)) * modulus * width * depth
    pushing = [draw(number(-aside, aside)) * pressing for _ in range(2)]
    return PadSensor(
        pad,
        NeoHookean(modulus, draw(number(0.4, 0.5))),
        (*pushing, -pressing),
        photo_reflector=draw(reflectors),
        roof=draw(walls),
        side=Wall("lambertian", draw(number(0.0, 0.9))),
    )


def scene_of(sensor: PadSensor, **changes: object) -> Scene:
    """The scene of a sensor, with changes of its photo-reflector."""
    source = sensor.scene().source
    parts = {"pad": {**source["pad"], "subdivision": 4}, "photo_reflector": {**source["photo_reflector"], **changes}}
    return Scene({**source, **parts}, mesh_size=mesh_size(sensor))


def mesh_size(sensor: PadSensor) -> float:
    return MESH_SIZE * sensor.pad.height


def read(scene: Scene, seed: int = 0, points: int = 128):
    return measure(scene, points=points, seed=seed, mechanics_error=False)


def assert_alike(first, second, order=slice(None)) -> None:
    """Readings are the same but for errors that are independent of each other."""
    error = np.hypot(first.standard_error, second.standard_error[order])
    z = (first.power - second.power[order]) / error
    significance = 1 - (1 - FALSE_ALARM_RATE) ** (1 / (z.size * EXAMPLES))
    assert np.all(np.abs(z) < stats.t.isf(significance / 2, df=31)), (z, first.power, second.power[order])


@few
@given(sensor=sensors())
def test_all_light_is_accounted_for_and_no_reading_exceeds_it(sensor):
    live = scene_of(sensor).load()
    audit = energy_audit(live, points=64)
    assert np.all(np.isfinite(audit.replicates)) and audit.replicates.min() > -1e-6
    assert audit.total == pytest.approx(1, abs=1e-9 + 4 * audit.total_error)
    readings = read(live)
    assert np.all(np.isfinite(readings.replicates))
    assert np.all((readings.power >= 0) & (readings.power <= sensor.photo_reflector.led.power))


@fewer  # of two cells each, without a symmetry
@given(sensor=sensors(rows=2, aside=0.2), across=st.sampled_from(["x", "y"]))
def test_a_mirrored_load_mirrors_the_readings(sensor, across):
    """Across y a photo-reflector is its own image; across x that is the one turned by half a turn."""
    import mitsuba as mi

    fx, fy, fz = sensor.force
    turned = mi.ScalarTransform4f().rotate([0, 0, 1], 180 if across == "x" else 0)
    image = replace(sensor, force=(-fx, fy, fz) if across == "x" else (fx, -fy, fz))
    first, second = read(scene_of(sensor), seed=1), read(scene_of(image, to_world=turned), seed=2)
    assert_alike(first, second, slice(None, None, -1))


@few
@given(sensor=sensors(), lower=number(0.2, 0.6), more=number(0.05, 0.35))
def test_brighter_walls_do_not_take_light_away(sensor, lower, more):
    dim, bright = (
        read(scene_of(replace(sensor, roof=replace(sensor.roof, reflectance=reflectance))), seed=3)
        for reflectance in (lower, lower + more)
    )
    gain = bright.replicates - dim.replicates  # the same random numbers
    error = gain.std(axis=0, ddof=1) / np.sqrt(len(gain))
    assert np.all(gain.mean(axis=0) >= -stats.t.isf(FALSE_ALARM_RATE / EXAMPLES, df=31) * error)


@few
@given(sensor=sensors(), factor=number(0.01, 100))
def test_readings_are_in_proportion_to_the_power(sensor, factor):
    led = sensor.photo_reflector.led
    bright = replace(sensor.photo_reflector, led=replace(led, power=factor * led.power))
    first, second = read(scene_of(sensor)), read(scene_of(replace(sensor, photo_reflector=bright)))
    np.testing.assert_allclose(second.replicates, factor * first.replicates, rtol=1e-5, atol=0)


@few
@given(sensor=sensors(), harder=number(1.1, 2.0))
def test_a_greater_force_presses_the_roof_further_down(sensor, harder):
    forces = [(0, 0, factor * sensor.force[2]) for factor in (0, 1, harder)]
    states = load_path(sensor.pad, sensor.material, forces, mesh_size=mesh_size(sensor))
    mesh = states[0].mesh
    roof = np.unique(mesh.faces[mesh.face_region == REGIONS["roof"]])
    heights = [float((mesh.points + state.displacement)[roof, 2].mean()) for state in states]
    assert heights[0] > heights[1] > heights[2]


@few
@given(sensor=sensors(), scale=number(0.1, 10))
def test_only_the_ratios_of_lengths_matter(sensor, scale):
    """All lengths times s, and forces times s squared."""
    pad, parts = sensor.pad, sensor.photo_reflector
    larger = Pad(
        pad.cell,
        pad.rows,
        pad.columns,
        *(scale * length for length in (pad.pitch, pad.wall, pad.height, pad.cell_size, pad.top_of_cell)),
    )
    led = replace(parts.led, size=scale * parts.led.size, hole=scale * parts.led.hole)
    receiver = parts.phototransistor
    receiver = replace(receiver, width=scale * receiver.width, depth=scale * receiver.depth)
    image = replace(
        sensor,
        pad=larger,
        force=tuple(scale**2 * component for component in sensor.force),
        photo_reflector=replace(
            parts,
            body=[scale * side for side in parts.body],
            spacing=scale * parts.spacing,
            led=led,
            phototransistor=receiver,
        ),
    )
    first, second = read(scene_of(sensor)), read(scene_of(image))
    assert_alike(first, second)
