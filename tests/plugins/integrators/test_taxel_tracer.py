"""The same reading by independent ways: three techniques, both directions of tracing, rays counted, Mitsuba's `path`.

Errors of some programming slips are the same in every scene that is symmetric or bounces once. So the rungs go from one
bounce off a plate over closed cells with many bounces to the guided paths of a deformed pad, and each is climbed by
estimators that share as little as possible. What a single technique cannot see, or only with a variance that has no
bound, is left out and said.
"""

from __future__ import annotations

import numpy as np
import pytest
from edited_pad import TWO_CELLS, edited

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.kernels.paths.guide import guide_for
from mitsuba_taxel.sensing.scene.taxels import taxels_of

TRACERS = {
    "all": {"type": "taxel_tracer"},
    "connections": {"type": "taxel_tracer", "strategy": "connections"},
    "sensor_subpath_connections": {"type": "taxel_tracer", "strategy": "sensor_subpath_connections"},
    "unidirectional_hits": {"type": "taxel_tracer", "strategy": "unidirectional_hits"},
    "taxel_path": {"type": "taxel_path"},
    "analog_tracer": {"type": "analog_tracer"},
    "path": {"type": "path"},
}
FROM_LED = ("unidirectional_hits", "analog_tracer")
WITH_MIRRORS = (*FROM_LED, "taxel_path", "path")
ON_PLATES = ("connections", "sensor_subpath_connections", *WITH_MIRRORS)
IN_CELLS = ("connections", *WITH_MIRRORS)
"""Sensor-subpath connections alone have no finite variance where two Lambertian walls share an edge."""

FEW_POINTS = {"all": 1 << 10, "unidirectional_hits": 1 << 13, "analog_tracer": 1 << 13}
"""That suffice above a plate, in no narrow gap."""
POINTS = {"all": 1 << 12, "unidirectional_hits": 1 << 14, "analog_tracer": 1 << 14, "path": 512}
USUAL_POINTS = 1 << 11
LARGEST_ERROR = 0.02
"""Relative standard error that each estimator must reach, so that agreement means something."""

MIXED = {"type": "wall", "scattering": "mixed", "specular": 0.3, "lambertian": 0.7}
MIXED_ISOTROPIC = {"type": "wall", "scattering": "mixed", "specular": 0.2, "lambertian": 0.3, "isotropic": 0.5}


def reflector(led=None, detector=None):
    """One photo-reflector, its top at z = 0.5."""
    return {
        "type": "photo_reflector",
        "spacing": 0.7,
        "led": {"type": "annular_led", "law": "lambertian", **(led or {})},
        "detector": {"type": "phototransistor", **(detector or {})},
    }


def plate(mi, z, wall, **parts):
    """A plate of 4 x 4 mm at a height z above LED and phototransistor."""
    to_world = mi.ScalarTransform4f().translate([0, 0, 0.5 + z]).scale(2)
    return {
        "reflector": reflector(**parts),
        "plate": {"type": "rectangle", "to_world": to_world, "bsdf": wall},
    }


def box(mi, wall):
    """A closed cell of 3 x 3 x 2 mm, with a floor, round a photo-reflector."""
    to_world = mi.ScalarTransform4f().translate([0, 0, 1]).scale([1.5, 1.5, 1])
    return {"reflector": reflector(), "box": {"type": "cube", "to_world": to_world, "bsdf": wall}}


def opposite(mi, distance, led, detector, led_half, detector_half, offset=(0.0, 0.0)):
    """An LED that looks up from z = 0, and a phototransistor that looks down on it; both are rectangles."""
    transform = mi.ScalarTransform4f
    above = transform().translate([*offset, distance]).rotate([1, 0, 0], 180)
    return {
        "lower": {
            "type": "rectangle",
            "to_world": transform().scale([*led_half, 1]),
            "led": {"type": "annular_led", "law": "lambertian", "hole": 0.0, **led},
            "bsdf": {"type": "wall", "scattering": "absorbing"},
        },
        "upper": {
            "type": "rectangle",
            "to_world": above.scale([*detector_half, 1]),
            "detector": {"type": "phototransistor", **detector},
            "bsdf": {"type": "wall", "scattering": "absorbing"},
        },
    }


def write_table(path, angles, values):
    path.write_text("".join(f"{a:g}, {v:.6g}\n" for a, v in zip(angles, values, strict=True)))
    return str(path)


def read(shapes, integrator, points, seed):
    scene = {"type": "scene", "integrator": integrator, **shapes}
    return measure(Scene(scene), points=points, seed=seed, mechanics_error=False)


def climb(agree, shapes, others, largest_error=LARGEST_ERROR, points=None):
    """Every estimator in ``others`` agrees with `taxel_tracer` as it is; ``shapes`` are those of the scene."""
    points = {**POINTS, **(points or {})}
    readings = {}
    for seed, name in enumerate(("all", *others)):
        readings[name] = read(shapes, TRACERS[name], points.get(name, USUAL_POINTS), 20 + seed)
        assert 0 < readings[name].relative_error < largest_error, name
    ours = readings.pop("all")
    theirs = [readings[name] for name in others]
    agree(
        np.concatenate([reading.power for reading in theirs]),
        np.concatenate([reading.standard_error for reading in theirs]),
        np.tile(ours.power, len(theirs)),
        np.tile(ours.standard_error, len(theirs)),
    )


@pytest.mark.parametrize("z", [0.3, 0.7, 1.5])
def test_lambertian_plate(llvm_mono, agree, z):
    """One bounce, by every way there is."""
    points = dict.fromkeys(FROM_LED, 1 << 15)
    climb(agree, plate(llvm_mono, z, {"type": "wall", "reflectance": 0.9}), ON_PLATES, points=points)


@pytest.mark.parametrize("wall, others, z", [(MIXED, WITH_MIRRORS, 0.3), (MIXED_ISOTROPIC, FROM_LED, 1.0)])
def test_mixed_plate(llvm_mono, agree, wall, others, z):
    """Light by way of the mirror is seen by hits alone; paths from the detector have no bound at an isotropic wall."""
    climb(agree, plate(llvm_mono, z, wall), others, points={"taxel_path": 1 << 14, "path": 1 << 13})


@pytest.mark.parametrize("rms_slope, z", [(3.0, 0.3), (15.0, 0.8)])
def test_rough_mirror_plate(llvm_mono, agree, rms_slope, z):
    """A narrow and a wide lobe, each against the same light seen from the other end."""
    wall = {"type": "wall", "scattering": "rough_mirror", "rms_slope": rms_slope}
    points = {name: 1 << 15 for name in ("connections", "sensor_subpath_connections", "taxel_path")} | {"path": 1 << 13}
    climb(agree, plate(llvm_mono, z, wall), ON_PLATES, points=points)


def test_closed_lambertian_cell(llvm_mono, agree):
    """Many bounces between walls that meet in edges and corners."""
    wall = {"type": "wall", "reflectance": 0.7}
    climb(agree, box(llvm_mono, wall), IN_CELLS)


@pytest.mark.parametrize("wall, others", [(MIXED, WITH_MIRRORS), (MIXED_ISOTROPIC, FROM_LED)])
def test_closed_mixed_cell(llvm_mono, agree, wall, others):
    """Mirrors and diffuse reflections one after another in any order."""
    climb(agree, box(llvm_mono, {**wall, "reflectance": 0.7}), others, points={"taxel_path": 1 << 14, "path": 1 << 13})


@pytest.mark.parametrize("response", ["cosine_power", "tabulated"])
def test_angular_response(llvm_mono, agree, tmp_path, response):
    """A phototransistor that prefers light from before it, above a Lambertian plate."""
    detector = {"response": response}
    if response == "cosine_power":
        detector["exponent"] = 4.0
    else:
        detector["file"] = write_table(tmp_path / "response.csv", (0, 15, 40, 75), (0.9, 1, 0.4, 0))
    climb(agree, plate(llvm_mono, 0.7, {"type": "wall"}, detector=detector), ON_PLATES, points=FEW_POINTS)


def test_narrow_response(llvm_mono, agree):
    """A phototransistor that sees a small part of a Lambertian plate: its own rays find it, points on walls do not."""
    detector = {"response": "cosine_power", "exponent": 300.0}
    shapes = plate(llvm_mono, 0.7, {"type": "wall"}, detector=detector)
    points = {"all": 1 << 6, "connections": 1 << 15, "sensor_subpath_connections": 1 << 6, "taxel_path": 1 << 7}
    climb(agree, shapes, ("connections", "sensor_subpath_connections", "taxel_path"), points=points)


@pytest.mark.parametrize("led", ["cosine_power", "tabulated", "circular"])
def test_light_sources(llvm_mono, agree, tmp_path, led):
    """Directional laws, and an emitting area between two circles."""
    parameters = {
        "cosine_power": {"law": "cosine_power", "exponent": 3.0},
        "tabulated": {"law": "tabulated"},
        "circular": {"shape": "circular", "size": 0.3, "hole": 0.2},
    }[led]
    if led == "tabulated":
        parameters["file"] = write_table(tmp_path / "led.csv", (0, 20, 50, 80), (0.5, 1, 0.6, 0))
    climb(agree, plate(llvm_mono, 0.6, {"type": "wall"}, led=parameters), ON_PLATES, points=FEW_POINTS)


@pytest.mark.parametrize("reflectance", [0.0, 0.8])
def test_face_to_face(llvm_mono, agree, reflectance):
    """Light that goes straight across, alone and with what a Lambertian wall beside it adds by many bounces."""
    mi = llvm_mono
    shapes = opposite(mi, 0.8, {}, {}, (0.2, 0.2), (0.3, 0.2), offset=(0.2, 0.1))
    aside = mi.ScalarTransform4f().translate([-0.6, 0, 0.4]).rotate([0, 1, 0], 90)
    shapes["wall"] = {"type": "rectangle", "to_world": aside, "bsdf": {"type": "wall", "reflectance": reflectance}}
    for name in ("lower", "upper"):
        shapes[name]["bsdf"] = {"type": "wall", "reflectance": reflectance}
    climb(agree, shapes, IN_CELLS, points=dict.fromkeys(FROM_LED, 1 << 16) | {"path": 1024})


@pytest.mark.parametrize(
    "scattering, fz, others",
    [
        ("lambertian", -2.5, ("connections", *WITH_MIRRORS)),
        ("isotropic", -2.5, ("connections", *FROM_LED)),
    ],
)
def test_hemispheric_pad(llvm_mono, agree, tmp_path, scattering, fz, others):
    """Paths guided between the triangles of a dome, and paths that know of no guide."""
    values = {"cell": "hemispheric", "scattering": scattering, "law": "lambertian", "fz": fz}
    live = Scene.from_file(edited(tmp_path, "two.xml", *TWO_CELLS), **values).load()
    assert guide_for(live, taxels_of(live)[0]) is not None
    shapes = dict(zip("abc", live.shapes(), strict=True))
    points = {"all": 256, "connections": 256, "taxel_path": 512, "path": 128}
    points |= {"unidirectional_hits": 2048, "analog_tracer": 2048}
    climb(agree, shapes, others, 0.07, points)
