"""What is said to be left out is left out, and nothing is said where it is not."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_taxel import Grooves, Pad, PadSensor, Scene, Wall, measure
from mitsuba_taxel.mechanics import NeoHookean, PatchForce, PlateForce, Pressure, SpreadForce
from mitsuba_taxel.sensing.reading.runs import prepare

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

ONE_PLANE = "all surfaces that reflect lie in one plane"
NO_PILOT = "no mirror: no pilot run"
CELL = Pad(rows=1, columns=1)
COARSE = 2.5
"""mm: what is said does not depend on how fine the elements are."""


def said(scene, **asked):
    from mitsuba_taxel.sensing.omitted_work import left_out

    return left_out(prepare(scene), **asked)


def has(lines, start):
    return any(line.startswith(start) for line in lines)


def pad_scene(reflectors=((0, 0),), **pad):
    """Three cells in a row, with photo-reflectors at the given places."""
    import mitsuba as mi

    from mitsuba_taxel.backend import activate_variant

    activate_variant()
    parts = {
        f"reflector_{number}": {
            "type": "photo_reflector",
            "to_world": mi.ScalarTransform4f().translate([x, y, 0]),
            "led": {"type": "annular_led"},
            "phototransistor": {"type": "phototransistor"},
        }
        for number, (x, y) in enumerate(reflectors)
    }
    walls = {"type": "region", "roof": {"type": "wall", "scattering": "isotropic"}}
    pad = {"type": "deformable_pad", "rows": 1, "columns": 3, "mesh_size": COARSE, "walls": walls, **pad}
    return Scene({"type": "scene", "integrator": {"type": "taxel_tracer"}, "pad": pad, **parts})


def test_a_plate_needs_no_mechanics(llvm_mono):
    lines = said("plate.xml")
    assert "no pad: no mechanics imported, meshed or solved" in lines
    assert "absorbing walls (body, led, phototransistor): paths end there" in lines
    assert not any("symmetric" in line or "cells" in line or "crosstalk" in line for line in lines)
    assert len(lines) == len(set(lines))


@pytest.mark.parametrize(
    "scene",
    [
        lambda: Scene.from_file("plate.xml", scattering="lambertian", z=0.3),
        lambda: Scene.from_file("plate.xml", scattering="mirror", offset_x=0.4),
        lambda: PadSensor(CELL).scene(),
        lambda: PadSensor(CELL, roof=Wall("lambertian", 0.8), side=Wall("lambertian", 0)).scene(),
    ],
)
def test_where_one_plane_reflects_a_second_reflection_changes_no_bit(llvm_mono, scene):
    ready = prepare(scene())
    assert has(said(ready), ONE_PLANE)
    free = measure(ready, points=256).replicates
    ready.integrator.max_depth = 1
    assert free.mean() > 0 and np.array_equal(measure(ready, points=256).replicates, free)


@pytest.mark.parametrize(
    "scene",
    [
        lambda: PadSensor(CELL, side=Wall("lambertian", 0.3)).scene(),
        lambda: PadSensor(Pad("spherical", rows=1, columns=1)).scene(),
    ],
)
def test_elsewhere_a_second_reflection_counts(llvm_mono, scene):
    ready = prepare(scene())
    assert not has(said(ready), ONE_PLANE)
    free = measure(ready, points=256).replicates
    ready.integrator.max_depth = 1
    assert np.all(measure(ready, points=256).replicates < free)


def test_shapes_whose_place_is_not_known_are_taken_to_be_seen(llvm_mono):
    scene = Scene.from_file("plate.xml").load()
    assert has(said(scene), ONE_PLANE)
    ball = {"type": "sphere", "center": [0, 0, 9], "bsdf": {"type": "wall"}}
    both = {"type": "scene", "ball": ball, **{f"part_{k}": shape for k, shape in enumerate(scene.shapes())}}
    lines = said(llvm_mono.load_dict({**both, "integrator": {"type": "taxel_tracer"}}))
    assert not has(lines, ONE_PLANE)


LOADS = [
    (SpreadForce(), (0, 0, -1)),
    (SpreadForce(), (0.5, 0, -1)),
    (SpreadForce(), (0, -0.5, 0)),
    (SpreadForce(), (0.5, 0.5, -1)),
    (SpreadForce(), (-0.3, 0.3, 0.2)),
    (SpreadForce(), (0.1 + 0.2, -0.3, 0)),
    (SpreadForce(), (0.3, 0.1, -1)),
    (PlateForce(), (0, 1, -1)),
    (PatchForce((0.4, 0), (1, 1)), (0, 0, -1)),
    (PatchForce((0.4, 0.4), (1, 1)), (0.1, 0.1, -1)),
    (PatchForce((0.3, 0.1), (1, 1)), (0, 0, -1)),
    (Pressure(), (0.1,)),
]


@pytest.mark.parametrize("columns", [1, 2])
@pytest.mark.parametrize("load, value", LOADS)
def test_mirrors_are_those_that_the_path_is_solved_with(load, value, columns):
    from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
    from mitsuba_taxel.sensing.omitted_work import _symmetric_segments

    path = pad_path(Pad(rows=1, columns=columns), NeoHookean(), load, 2.0)
    value = np.array(value, dtype=float)
    told = [
        (tuple(end), len(mirrors))
        for end, mirrors in _symmetric_segments(SimpleNamespace(bodies=None, mesh=path.mesh, load=load, value=value))
    ]
    solved = [
        (tuple(segment.value(s)), path.segments.pad_for(segment.origin, segment.direction).part.mirrors)
        for segment, s in path.segments.to(value)
    ]
    solved = [segment for segment in solved if segment[1]]
    assert [count for _, count in told] == [count for _, count in solved]
    for (end, _), (reached, _) in zip(told, solved, strict=True):
        assert end == pytest.approx(reached, abs=1e-11)


def test_symmetry_in_words(llvm_mono):
    scene = PadSensor(CELL, force=(0.1, 0, -0.5)).scene().with_mesh_size(COARSE)
    normal, tangential = (line for line in said(scene) if line.startswith("symmetric pad and load: "))
    assert normal.endswith(
        "an eighth of the pad solved on the way to force (0, 0, -0.5) N, mirrored in x = 0, y = 0, y = -x, y = x"
    )
    assert tangential.endswith("half of the pad solved on the way to force (0.1, 0, -0.5) N, mirrored in y = 0")


def test_a_pad_without_load_is_only_meshed(llvm_mono):
    unloaded = said(pad_scene())
    assert "pad without load: meshed, nothing solved" in unloaded
    assert "pad without load: no error of the mechanics to estimate" in unloaded
    assert not has(unloaded, "symmetric")
    loaded = said(pad_scene(force=[0, 0, -0.5]))
    assert not has(loaded, "pad without load") and has(loaded, "symmetric pad and load: a quarter")


def test_a_tolerance_of_the_mesh_takes_solutions():
    from mitsuba_taxel.sensing.omitted_work import _of_pad

    state = SimpleNamespace(value=np.zeros(3))
    pad = SimpleNamespace(is_loaded=False, remembers=False, mesh_tolerance=0.5, finish=None, state=state)
    lines = list(_of_pad(pad))
    assert not has(lines, "pad without load: meshed") and has(lines, "pad without load: no error")


def test_cells_that_nothing_reads(llvm_mono):
    middle, last = (0, 0), (3.55, 0)
    coarse, dark = "of 3 cells not read: their walls divided into few triangles", "of 3 cells: no path starts there"
    lines = said(pad_scene([middle], read_cells="2"))
    assert f"2 {coarse}" in lines and f"no photo-reflector in 2 {dark}" in lines
    lines = said(pad_scene([middle, last], read_cells="1, 3"))
    assert f"1 {coarse}" in lines and f"no photo-reflector in 1 {dark}" in lines
    lines = said(pad_scene([middle, last, (-3.55, 0)]))
    assert not any(coarse in line or dark in line for line in lines)
    one, all_ = (prepare(pad_scene([middle], read_cells=cells)).scene for cells in ("2", "all"))
    faces = [max(shape.face_count() for shape in scene.shapes() if shape.is_mesh()) for scene in (one, all_)]
    assert faces[0] < 0.6 * faces[1]


def test_a_pad_elsewhere_keeps_its_cells(llvm_mono):
    mi = llvm_mono
    turned = mi.ScalarTransform4f().translate([20, 0, 0]).rotate([0, 0, 1], 90)
    lines = said(pad_scene([(20, 0), (20, 3.55)], to_world=turned))
    assert "no photo-reflector in 1 of 3 cells: no path starts there" in lines


def test_a_finish_is_not_left_out(llvm_mono):
    smooth = "smooth cells: no finish computed"
    assert smooth in said(PadSensor(CELL).scene())
    assert smooth not in said(PadSensor(CELL, finish=Grooves(0.5, 0.02)).scene())


def test_kept_solutions_are_said_once_nothing_is_computed(llvm_mono, tmp_path, monkeypatch):
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path))
    kept = "meshes and solutions found in the disk cache: nothing meshed or solved again"
    scene = pad_scene(columns=1, height=4.613)
    began = time.time() - 1  # the file system's clock may be a little behind
    ready = prepare(scene)
    assert kept not in said(ready, began=began) and kept not in said(ready)
    assert list(tmp_path.glob("*.npz"))
    later = time.time() + 1
    assert kept in said(prepare(scene), began=later)
    assert kept not in said("plate.xml", began=later)


@pytest.mark.parametrize("scattering", ["mirror", "rough_mirror", "mixed", "lambertian", "isotropic", "absorbing"])
def test_pilot_runs_are_those_that_the_tracer_makes(llvm_mono, monkeypatch, scattering):
    from mitsuba_taxel.kernels.paths import emission_guiding
    from mitsuba_taxel.sensing.scene.taxels import taxels_of

    monkeypatch.setattr(emission_guiding, "_learn", lambda *_: np.ones((1, 32, 32)))
    own = {"mixed": {"specular": 0.5, "lambertian": 0.5}, "rough_mirror": {"rms_slope": 5.0}}.get(scattering, {})
    plate = {"type": "wall", "scattering": scattering, **own}
    mi = llvm_mono
    faced_down = mi.ScalarTransform4f().translate([0, 0, 1.2]).rotate([1, 0, 0], 180)
    ready = prepare(
        mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "taxel_tracer"},
                "plate": {"type": "rectangle", "to_world": faced_down, "bsdf": plate},
                "reflector": {
                    "type": "photo_reflector",
                    "led": {"type": "annular_led"},
                    "phototransistor": {"type": "phototransistor"},
                },
            }
        )
    )
    (pair,) = taxels_of(ready.scene)
    lines = said(ready)
    assert has(lines, NO_PILOT) == (emission_guiding.guided_emission(ready.integrator, ready.scene, pair) is None)
    assert any("plate): paths end there" in line for line in lines) == (scattering == "absorbing")


def test_what_is_asked_for_is_not_left_out(llvm_mono):
    scene = prepare(pad_scene([(0, 0), (3.55, 0)]))
    crosstalk = "crosstalk not requested: 2 pairs of LED and phototransistor traced, not 4"
    image, band = "irradiance map not requested: none accumulated", "one narrow band of wavelengths"
    lines = said(scene)
    assert crosstalk in lines and image in lines and has(lines, band)
    lines = said(scene, irradiance=True, crosstalk=True)
    assert crosstalk not in lines and image not in lines


def test_three_channels_are_traced_by_the_integrators_of_others_alone(llvm_mono, tmp_path):
    """Those of this package trace the first: in three channels their kernel is no larger."""
    import drjit as dr

    band, operations = "one narrow band of wavelengths", []
    for variant in ("llvm_ad_mono", "llvm_ad_rgb"):
        llvm_mono.set_variant(variant)
        ready = prepare(Scene.from_file("plate.xml", scattering="lambertian"))
        assert has(said(ready), band)
        assert has(said(stock(tmp_path)), band) == (variant == "llvm_ad_mono")
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            measure(ready, points=64)
            operations.append(max(kernel["operation_count"] for kernel in dr.kernel_history([dr.KernelType.JIT])))
    assert operations[0] > 1000 and operations[1] == pytest.approx(operations[0], rel=0.01)


def stock(folder):
    """`plate.xml` under Mitsuba's own path tracer."""
    from mitsuba_taxel.sensing import find_scene

    file = folder / "plate.xml"
    file.write_text(find_scene("plate.xml").read_text().replace("taxel_tracer", "path"))
    return Scene.from_file(file, scattering="lambertian")


def test_of_the_integrators_of_others_nothing_is_said(llvm_mono, tmp_path):
    lines = said(stock(tmp_path))
    assert has(lines, "absorbing walls") and not has(lines, ONE_PLANE) and not has(lines, NO_PILOT)


def test_light_straight_across(llvm_mono):
    """LED and phototransistor of two bodies that face each other."""
    mi = llvm_mono
    across = "LED and phototransistor in one plane"
    assert has(said("plate.xml"), across)
    apart = {
        "type": "scene",
        "integrator": {"type": "taxel_tracer"},
        "below": {"type": "rectangle", "led": {"type": "annular_led"}},
        "above": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().translate([0, 0, 1]).rotate([1, 0, 0], 180),
            "phototransistor": {"type": "phototransistor"},
        },
    }
    assert not has(said(mi.load_dict(apart)), across)
