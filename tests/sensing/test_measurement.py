"""What a reading promises: an honest error, no needless kernels, the right integrator, runs that go on, crosstalk."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from edited_pad import TWO_CELLS, edited
from plate_reference import image_power, plate_power

from mitsuba_taxel import InputError, Scene, crosstalk, measure, sweep

FALSE_ALARM_RATE = 1e-4
MIXED = {"scattering": "mixed", "specular": 0.3, "lambertian": 0.7}
ISOTROPIC = {"scattering": "isotropic"}
TRACERS = ("taxel_tracer", "taxel_path", "analog_tracer")


def reflector(led=None, detector=None, **parameters):
    return {
        "type": "photo_reflector",
        "spacing": 0.7,
        "led": {"type": "annular_led", "law": "lambertian", "hole": 0.0, **(led or {})},
        "detector": {"type": "phototransistor", **(detector or {})},
        **parameters,
    }


def cover(mi, z, wall):
    """A plate of 4 x 4 mm at a height z above LED and phototransistor."""
    to_world = mi.ScalarTransform4f().translate([0, 0, 0.5 + z]).scale(2)
    return {"type": "rectangle", "to_world": to_world, "bsdf": {"type": "wall", **wall}}


def plate(mi, z=0.7, wall=None, **parts):
    return {"reflector": reflector(**parts), "plate": cover(mi, z, wall or {})}


def box(mi, wall):
    """A closed cell of 3 x 3 x 2 mm, with a floor, round a photo-reflector."""
    to_world = mi.ScalarTransform4f().translate([0, 0, 1]).scale([1.5, 1.5, 1])
    return {"reflector": reflector(), "box": {"type": "cube", "to_world": to_world, "bsdf": {"type": "wall", **wall}}}


def scene(shapes, integrator="taxel_tracer"):
    named = {} if integrator is None else {"integrator": {"type": integrator}}
    return Scene({"type": "scene", **named, **shapes})


def write_table(path, rows):
    path.write_text("".join(f"{x:g}, {y:g}\n" for x, y in rows))
    return str(path)


# The standard error


@pytest.mark.parametrize("z, scattering, power", [(0.7, "lambertian", 0.019702463), (0.5, "mirror", None)])
def test_the_truth_lies_within_the_stated_errors(llvm_mono, z, scattering, power):
    """Nominal 95 % Student intervals of 150 readings of few points cover it as often as 150 draws of 95 % would."""
    from scipy import stats

    truth = plate_power(z) if scattering == "lambertian" else image_power(z)
    if power is not None:
        assert truth == pytest.approx(power, rel=1e-7)
    live = scene(plate(llvm_mono, z, {"scattering": scattering})).load()
    covered = 0
    for seed in range(150):
        reading = measure(live, points=256, seed=seed)
        half_width = stats.t.ppf(0.975, len(reading.replicates) - 1) * reading.standard_error[0]
        covered += abs(reading.power[0] - truth) < half_width
    low, high = stats.binom.interval(1 - FALSE_ALARM_RATE, 150, 0.95)
    assert low <= covered <= high


# Variants and kernels


@pytest.mark.parametrize("integrator", ["path", "ptracer"])
def test_an_led_that_is_alive_elsewhere_does_not_disturb(llvm_mono, integrator):
    """Dr.Jit records a call of emitters for each of them that is alive, one that no surface carries among them."""
    loaded = scene(box(llvm_mono, {"reflectance": 0.7}), integrator)
    alone = measure(loaded, points=256, seed=1).power
    stray = llvm_mono.load_dict({"type": "annular_led"})
    again = scene(box(llvm_mono, {"reflectance": 0.7}), integrator)
    np.testing.assert_allclose(measure(again, points=256, seed=1).power, alone, rtol=1e-5)
    assert stray.get_shape() is None


@pytest.mark.parametrize("integrator", [*TRACERS, "path"])
@pytest.mark.parametrize("wall", [{"reflectance": 0.7}, {"scattering": "rough_mirror", "rms_slope": 10.0}])
def test_mono_and_rgb_read_the_same(llvm_mono, integrator, wall):
    """In a closed cell: the same random numbers make the same paths."""
    power = {}
    for variant in ("llvm_ad_mono", "llvm_ad_rgb"):
        llvm_mono.set_variant(variant)
        power[variant] = measure(scene(box(llvm_mono, wall), integrator), points=256, seed=1).power
    assert power["llvm_ad_mono"][0] > 0
    assert power["llvm_ad_rgb"] == pytest.approx(power["llvm_ad_mono"], rel=1e-5)


def kernels(description, seed=3):
    """Hashes of the kernels of a measurement: those kept on disk from an earlier run would all count as cache hits."""
    import drjit as dr

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        measure(description, points=256, seed=seed)
        return {entry["hash"] for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT}


def same_kernels(first, second):
    """Whether a measurement runs nothing that another one, done before, has not compiled.

    Kernels also depend on the order in which Dr.Jit numbers the objects of a scene. That may change from one loading
    to the next with what has been freed before, whatever the parameters; so the first scene is loaded a few times.
    """
    known = set().union(*(kernels(first) for _ in range(3)))
    again = kernels(second)
    return bool(again) and again <= known


@pytest.mark.parametrize("integrator", [*TRACERS, "path"])
def test_another_seed_needs_no_new_kernel(llvm_mono, integrator):
    """Nor do the seeds of the replicates, which `path` gets one by one.

    In the first kernel of a loaded scene for a CUDA card, Dr.Jit numbers the registers otherwise than in later ones.
    """
    live = scene(plate(llvm_mono), integrator).load()
    known = kernels(live, seed=1) | kernels(live, seed=1)
    assert known and kernels(live, seed=77) <= known


@pytest.mark.parametrize("integrator", TRACERS)
@pytest.mark.parametrize(
    "first, second",
    [
        (MIXED, {"scattering": "mixed", "specular": 0.1, "lambertian": 0.9, "reflectance": 0.5}),
        ({"scattering": "rough_mirror", "rms_slope": 3.0}, {"scattering": "rough_mirror", "rms_slope": 11.5}),
    ],
)
def test_another_wall_of_its_kind_needs_no_new_kernel(llvm_mono, integrator, first, second):
    assert same_kernels(*(scene(plate(llvm_mono, wall=wall), integrator) for wall in (first, second)))


@pytest.mark.parametrize("integrator", ["taxel_tracer", "analog_tracer"])
def test_another_isotropic_share_needs_no_new_kernel(llvm_mono, integrator):
    """By the integrators that take isotropic walls."""
    walls = ({"scattering": "mixed", "specular": s, "isotropic": 1 - s} for s in (0.0, 0.6))
    assert same_kernels(*(scene(plate(llvm_mono, wall=wall), integrator) for wall in walls))


@pytest.mark.parametrize("integrator", TRACERS)
def test_another_led_or_response_of_its_kind_needs_no_new_kernel(llvm_mono, tmp_path, integrator):
    a = write_table(tmp_path / "a.csv", [(0, 1), (30, 0.5), (80, 0)])
    b = write_table(tmp_path / "b.csv", [(0, 1), (10, 2), (20, 0.9), (60, 0.1)])
    exponents = [
        plate(
            llvm_mono,
            led={"law": "cosine_power", "exponent": m, "wavelength": nm},
            detector={"response": "cosine_power", "exponent": n},
        )
        for m, nm, n in ((1.0, 925.0, 1.0), (7.5, 850.0, 3.5))
    ]
    tables = [
        plate(
            llvm_mono,
            led={"law": "tabulated", "file": led},
            detector={"response": "tabulated", "file": response},
        )
        for led, response in ((a, b), (b, a))
    ]
    for shapes in (exponents, tables):
        assert same_kernels(*(scene(s, integrator) for s in shapes))


# Reflectance tables


@pytest.mark.parametrize("integrator", [*TRACERS, "path"])
@pytest.mark.parametrize("wavelength, reflectance", [(900.0, 0.7), (950.0, 0.75), (850.0, 0.4)])
def test_a_table_reads_as_its_value(llvm_mono, tmp_path, integrator, wavelength, reflectance):
    """Linear between the rows, and with the same random numbers the same reading."""
    table = write_table(tmp_path / "table.csv", [(800, 0.2), (850, 0.4), (875, 0.65), (925, 0.75), (1000, 0.75)])
    powers = [
        measure(scene(plate(llvm_mono, wall=wall, led={"wavelength": wavelength}), integrator), points=256).replicates
        for wall in ({"reflectance_table": table}, {"reflectance": reflectance})
    ]
    assert powers[0] == pytest.approx(powers[1], rel=1e-6) and powers[0].mean() > 0


def test_a_wavelength_outside_the_table_is_refused(llvm_mono, tmp_path):
    table = write_table(tmp_path / "table.csv", [(800, 0.2), (1000, 0.8)])
    shapes = plate(llvm_mono, wall={"reflectance_table": table}, led={"wavelength": 1050.0})
    for integrator in (*TRACERS, "path", None):
        with pytest.raises(InputError, match="no reflectance at the wavelength of 1050 nm: it covers 800 to 1000 nm"):
            measure(scene(shapes, integrator), points=16)


@pytest.mark.parametrize("integrator", TRACERS)
def test_leds_of_several_wavelengths_each_see_their_own_reflectance(llvm_mono, tmp_path, integrator):
    """Each pair of a scene reads as in the same scene under the one reflectance of its LED's wavelength."""
    mi = llvm_mono
    table = write_table(tmp_path / "table.csv", [(800, 0.2), (1000, 0.8)])

    def shapes(wall):
        return {
            **{
                f"reflector{i}": reflector(
                    led={"wavelength": nm}, to_world=mi.ScalarTransform4f().translate([0, 1.2 * (i - 1), 0])
                )
                for i, nm in enumerate((850.0, 1000.0, 900.0))
            },
            "plate": cover(mi, 0.7, wall),
        }

    reading = measure(scene(shapes({"reflectance_table": table}), integrator), points=256).replicates
    for i, reflectance in enumerate((0.35, 0.8, 0.5)):
        alone = measure(scene(shapes({"reflectance": reflectance}), integrator), points=256).replicates
        assert reading[:, i] == pytest.approx(alone[:, i], rel=1e-6) and alone[:, i].mean() > 0


# The integrator that is chosen


@pytest.mark.parametrize(
    "wall, led, detector, other",
    [
        (ISOTROPIC, {}, {}, "analog_tracer"),
        ({"scattering": "mixed", "isotropic": 1.0}, {}, {}, "analog_tracer"),
        ({}, {"law": "uniform_polar_angle"}, {}, "analog_tracer"),
        (ISOTROPIC, {}, {"response": "cosine_power", "exponent": 20.0}, "analog_tracer"),
        ({}, {}, {"response": "cosine_power", "exponent": 20.0}, "taxel_path"),
        ({}, {}, {"response": "cosine_power", "exponent": 2.0}, "taxel_path"),
    ],
)
def test_a_scene_that_names_no_integrator(llvm_mono, agree, wall, led, detector, other):
    """The note says which integrator reads it and why; it reads as if named, and agrees with another one."""
    shapes = plate(llvm_mono, wall=wall, led=led, detector=detector)
    ours = measure(scene(shapes, None), points=4096, seed=1)
    notes = [note for note in ours.notes if note.startswith("integrator taxel_tracer: ")]
    assert len(notes) == 1 and "connects paths" in notes[0]
    named = measure(scene(shapes, "taxel_tracer"), points=4096, seed=1)
    assert np.array_equal(ours.replicates, named.replicates)
    assert not any(note.startswith("integrator") for note in named.notes)
    theirs = measure(scene(shapes, other), points=1 << 15, seed=2)
    assert ours.relative_error < 0.01 and theirs.relative_error < 0.04
    agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


@pytest.mark.parametrize(
    ("wall", "led"), [({"scattering": "mirror"}, {}), ({}, {"law": "uniform_solid_angle", "cone_angle": 20.0})]
)
def test_paths_from_a_narrow_phototransistor_miss_mirrored_and_narrow_light(llvm_mono, wall, led):
    """So that `taxel_path` is not chosen there: its variance there is more than four times that of `taxel_tracer`."""
    shapes = plate(llvm_mono, wall=wall, led=led, detector={"response": "cosine_power", "exponent": 30.0})
    errors = {name: measure(scene(shapes, name), points=512, seed=1).relative_error for name in TRACERS[:2]}
    assert errors["taxel_path"] > 2 * errors["taxel_tracer"]


# Runs that go on


@pytest.mark.parametrize("integrator", TRACERS)
@pytest.mark.parametrize("first", [256, 1024])
def test_a_continued_run_is_one_longer_run(llvm_mono, integrator, first):
    """To the bit, in a cell where paths use more dimensions than the sampler has."""
    description = scene(box(llvm_mono, {"reflectance": 0.7}), integrator)
    start = measure(description, points=first, seed=4)
    longer = measure(description, points=2048, seed=4, continued=start)
    whole = measure(description, points=2048, seed=4)
    assert longer.points == whole.points == 2048
    assert np.array_equal(longer.replicates, whole.replicates)
    assert not np.array_equal(start.replicates, whole.replicates)


# Crosstalk


@pytest.mark.parametrize(("cell", "cells", "edits"), [("parallelepiped", 9, ()), ("hemispheric", 2, TWO_CELLS)])
def test_closed_cells_have_no_crosstalk(llvm_mono, agree, tmp_path, cell, cells, edits):
    """On the diagonal are the readings, elsewhere nothing: the cells of a pad are closed."""
    pad = edited(tmp_path, "pad.xml", *edits)
    description = Scene.from_file(pad, cell=cell, scattering="lambertian", law="lambertian")
    reading = measure(description, points=256, seed=1)
    matrix = crosstalk(description, points=256, seed=2)
    assert matrix.power.shape == (cells, cells)
    diagonal, error = np.diag(matrix.power), np.diag(matrix.standard_error)
    assert np.all(error < 0.01 * diagonal)
    agree(diagonal, error, reading.power, reading.standard_error)
    assert np.all(matrix.replicates[:, ~np.eye(cells, dtype=bool)] == 0)


def test_crosstalk_of_a_loaded_pad_has_the_error_of_its_elements(llvm_mono, tmp_path):
    """That of the readings, on the diagonal, within the noise of both; without a load there is none."""
    pad = edited(tmp_path, "pad.xml", *TWO_CELLS)
    told = {"cell": "parallelepiped", "scattering": "lambertian", "law": "lambertian"}
    matrix = crosstalk(Scene.from_file(pad, fz=-0.5, **told), points=256, seed=2)
    share = np.diag(matrix.mechanics_error) / np.diag(matrix.power)
    reading = measure(Scene.from_file(pad, fz=-0.5, **told), points=256, seed=1)
    assert share == pytest.approx(reading.mechanics_error / reading.power, rel=0.2) and (share > 0).all()
    total = np.hypot(matrix.standard_error, matrix.mechanics_error)
    assert matrix.total_error == pytest.approx(total)
    assert "light and finite elements" in str(matrix)
    free = crosstalk(Scene.from_file(pad, **told), points=64)
    assert free.deviation is None and not free.mechanics_error.any() and "of the light" in str(free)


@pytest.mark.parametrize("integrator", ["taxel_tracer", "taxel_path"])
@pytest.mark.parametrize("led, detector", [(0, 1), (1, 0)])
def test_crosstalk_under_an_open_plate(llvm_mono, agree, integrator, led, detector):
    """Of two photo-reflectors, against a scene that holds only the LED of the one and the other's phototransistor."""
    mi = llvm_mono
    pitch = 1.6
    roof = cover(mi, 0.7, {"reflectance": 0.9})
    both = {"reflectors": reflector(columns=2, pitch=pitch), "plate": roof}
    matrix = crosstalk(scene(both, integrator), points=4096, seed=1)
    reading = measure(scene(both, integrator), points=4096, seed=2)
    agree(np.diag(matrix.power), np.diag(matrix.standard_error), reading.power, reading.standard_error)

    def at(x, half_x, half_y, **nested):
        to_world = mi.ScalarTransform4f().translate([x, 0, 0.5]).scale([half_x, half_y, 1])
        black = {"type": "wall", "scattering": "absorbing"}
        return {"type": "rectangle", "to_world": to_world, "bsdf": black, **nested}

    alone = {
        "led": at((led - 0.5) * pitch - 0.35, 0.125, 0.125, part=reflector()["led"]),
        "detector": at((detector - 0.5) * pitch + 0.35, 0.26, 0.15, part=reflector()["detector"]),
        "plate": roof,
    }
    expected = measure(scene(alone, integrator), points=4096, seed=3)
    assert expected.relative_error < 0.01
    agree(matrix.power[led, detector], matrix.standard_error[led, detector], expected.power, expected.standard_error)


def test_one_value_may_be_varied_by_itself():
    study = sweep("plate.xml", {"z": 1}, points=16)
    assert study.sizes["z"] == 1 and float(study.z[0]) == 1


def test_changed_parameters_need_no_new_kernel(llvm_mono):
    """Numbers are kernel parameters: another force, height or reflectance compiles nothing."""
    import drjit as dr

    from mitsuba_taxel import measure

    def kernels(**values):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            measure(Scene.from_file("plate.xml", **values), points=256, seed=3)
            return [entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]

    gc.collect()  # parts of refused scenes, which other tests have left, would be in the first kernels alone
    kernels(z=0.7, scattering="lambertian")
    again = kernels(z=0.93, hole=0.05, spacing=0.81, width=3, offset_x=0.2, scattering="lambertian")
    assert again and all(entry["cache_hit"] for entry in again)
