"""Work-precision diagrams: slopes, who judges whom, what is left out and why, files."""

from __future__ import annotations

import csv
import math
import os
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from power_law_curve import line
from scipy import stats

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.accuracy import accuracy as bench_accuracy
from mitsuba_taxel.evidence.accuracy import chain as accuracy_chain
from mitsuba_taxel.evidence.accuracy import mechanics as accuracy_mechanics
from mitsuba_taxel.evidence.accuracy import optics as accuracy_optics
from mitsuba_taxel.evidence.accuracy.accuracy import accuracy, title
from mitsuba_taxel.evidence.accuracy.chain import near_load
from mitsuba_taxel.evidence.accuracy.mechanics import from_nothing, open_pads, solve
from mitsuba_taxel.evidence.accuracy.methods import METHODS, Method, estimator, is_bounded, offset_share, stray_light
from mitsuba_taxel.evidence.accuracy.plot import plot_accuracy
from mitsuba_taxel.evidence.accuracy.tables import COLUMNS, HEADINGS, cells, write_csv
from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, TruthEstimate, slope
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.continuation import load_segment
from mitsuba_taxel.mechanics.continuation import pad_path as path
from mitsuba_taxel.mechanics.equilibrium.pad_parts import loaded_pad
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.reading.runs import prepare

PLATE = """<scene version="3.9.0">
    {integrator}
    <shape type="photo_reflector">
        <integer name="columns" value="{columns}"/> <float name="pitch" value="3"/>
        <emitter type="annular_led"/>
        <sensor type="phototransistor"> {response} </sensor>
    </shape>
    <shape type="rectangle">
        <transform name="to_world">
            <rotate x="1" angle="180"/> <scale x="2" y="2"/> <translate z="1.2"/>
        </transform>
        <bsdf type="wall"> <string name="scattering" value="{scattering}"/> </bsdf>
    </shape>
</scene>"""
CELL = """<scene version="3.9.0">
    <default name="fx" value="0"/> <default name="fz" value="-1"/>
    {integrator}
    <shape type="deformable_pad">
        <integer name="rows" value="1"/> <integer name="columns" value="1"/>
        <vector name="force" value="$fx, 0, $fz"/>
        {mesh} <integer name="subdivision" value="4"/>
        <bsdf type="region">
            <bsdf name="roof" type="wall"> <string name="scattering" value="{scattering}"/> </bsdf>
        </bsdf>
    </shape>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
    <shape type="rectangle">
        <transform name="to_world"><scale value="10"/></transform>
        <bsdf type="wall"> <string name="scattering" value="absorbing"/> </bsdf>
    </shape>
</scene>"""
TRACER, PATH, ANALOG = (Method(name) for name in ("taxel_tracer", "taxel_path", "analog_tracer"))
STOCK = Method("path", "independent")


@pytest.fixture(scope="module")
def meshes():
    """Pads are meshed once for all tests: what the meshing costs is not theirs to tell."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Pad, "mesh", lru_cache(Pad.mesh))
        yield


@pytest.fixture
def write(tmp_path, meshes):
    """A function that writes one of the scenes above and describes it."""

    def scene(template: str, **values: object) -> Scene:
        defaults = {"integrator": "", "columns": 1, "response": "", "scattering": "lambertian", "mesh": ""}
        file = tmp_path / "scene.xml"
        file.write_text(template.format(**{**defaults, **values}))
        return Scene.from_file(file)

    return scene


@pytest.fixture
def clockwork(monkeypatch):
    """Make seconds count samples, so that slopes are the same on every machine, and few methods run."""
    seconds = [0.0]
    real = accuracy_optics.estimator

    def timed(*arguments):
        estimate = real(*arguments)

        def run(samples, seed):
            seconds[0] += 1e-3 + 1e-6 * samples
            return estimate(samples, seed)

        return run

    monkeypatch.setattr(accuracy_optics, "estimator", timed)
    monkeypatch.setattr(accuracy_optics, "now", lambda: seconds[0])
    return lambda *methods: monkeypatch.setattr(accuracy_optics, "METHODS", methods)


@pytest.mark.usefixtures("painted_figures")
def test_quasi_random_points_gain_more_than_random_ones(clockwork, tmp_path):
    connections = Method("taxel_tracer", strategy="connections")
    clockwork(TRACER, PATH, STOCK, connections)
    steps = []
    scene = Scene.from_file("plate.xml", scattering="lambertian")
    curves = accuracy(scene, tmp_path / "out", 0.5, steps.append)
    found = {curve.method: curve for curve in curves}
    slopes = {name: slope(curve) for name, curve in found.items() if curve.part == "optics"}
    assert slopes["taxel_tracer"].value + slopes["taxel_tracer"].standard_error < -0.7
    assert slopes["taxel_path"].value < -0.7
    random = slopes["path (independent)"]
    assert abs(random.value + 0.5) < 3.5 * random.standard_error < 0.5
    judges = {name: {point.reference for point in curve.points} for name, curve in found.items() if curve.points}
    assert judges["taxel_tracer"] == judges["taxel_tracer connections"] == judges["reading"] == {"taxel_path"}
    assert judges["taxel_path"] == {"taxel_tracer"} and judges["path (independent)"] < {"taxel_tracer", "taxel_path"}
    last = found["taxel_tracer"].points[-1]
    assert 0.3 < last.stated / last.error < 3 and last.floor < 0.5 * last.error < 1e-3
    assert found[""].remark == "no pad of the scene is loaded"
    assert "optics 1/4: taxel_tracer" in steps and "optics: reference by taxel_path" in steps

    with (tmp_path / "out" / "accuracy.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert tuple(rows[0]) == COLUMNS
    assert float(rows[0]["error"]) == found["taxel_tracer"].points[0].error
    assert {row["stated_error"] for row in rows if row["method"] == "path (independent)"} == {""}
    with Image.open(tmp_path / "out" / "accuracy.png") as image:
        assert image.width > 1000 and image.height > 600 and len(image.getcolors(1 << 20)) > 20
    assert (tmp_path / "out" / "accuracy.svg").read_text().count("<path") > 50


def test_methods_that_cannot_do_a_scene_say_why(clockwork, write, tmp_path):
    connections = Method("taxel_tracer", strategy="connections")
    clockwork(TRACER, connections, PATH, STOCK, ANALOG)
    scene = write(PLATE, columns=2, scattering="mirror")
    assert 1e-3 < stray_light(scene) < 1
    curves, truth = accuracy_optics.optics_curves(scene, 0.02, lambda step: None)
    remarks = {curve.method: curve.remark for curve in curves if not curve.points}
    assert remarks.pop("taxel_tracer connections") == "this method finds no light in this scene"
    assert "lights all LEDs at once" in remarks.pop("path (independent)") and not remarks
    assert truth.name in ("taxel_path", "analog_tracer") and truth.floor < 0.1
    shown = dict(zip(HEADINGS, cells(curves[1]), strict=True))
    assert shown["remark"] == "not possible: this method finds no light in this scene" and shown["points"] == "0"


@pytest.mark.parametrize("height", [0.7, 2.0])
def test_rays_of_mitsuba_start_off_their_surface(height):
    """Half of the rays that leave a point after the cosine law go sqrt(2) times as far to a plane, or less."""
    half = 20
    share = offset_share(Scene.from_file("plate.xml", z=height, width=2 * half, depth=2 * half))
    assert 9e-5 * (1 + 0.8 * half) < share * math.sqrt(2) * height < 1.05 * 9e-5 * (1 + half)


def test_isotropic_walls_leave_paths_from_the_detector_out(clockwork, write):
    clockwork(TRACER, PATH, STOCK, ANALOG)
    scene = write(PLATE, scattering="isotropic")
    assert not is_bounded(scene) and is_bounded(write(PLATE))
    scene = write(PLATE, scattering="isotropic")
    curves, truth = accuracy_optics.optics_curves(scene, 0.02, lambda step: None)
    remarks = {curve.method: curve.remark for curve in curves}
    assert "unbounded" in remarks["taxel_path"] and "unbounded" in remarks["path (independent)"]
    assert truth.name == "path (independent)"
    clockwork(TRACER, PATH)
    with pytest.raises(ComputationError, match="fewer than two independent methods.*taxel_path: isotropic walls"):
        accuracy_optics.optics_curves(scene, 0.02, lambda step: None)


def test_a_method_that_is_off_is_said_to_be():
    rng = np.random.default_rng(0)
    truth = TruthEstimate(np.ones(3), np.full(3, 1e-5), "other")
    for bias, said in ((0.0, ""), (0.01, "deviates by +0.01 of the reference")):
        power = 1 + bias + rng.normal(0, 1e-3, (8, 3))
        rungs = [accuracy_optics.SampleRuns(1 << k, power, np.full((8, 3), math.nan), 0.1) for k in (10, 11)]
        curve = accuracy_optics._curve(accuracy_optics._Trial(STOCK, rungs), truth, False)
        assert curve.remark.startswith(said) and bool(curve.remark) == bool(said)


@pytest.mark.parametrize("limit", ["", '<integer name="max_depth" value="1"/>'])
def test_all_methods_follow_as_many_reflections(write, tmp_path, agree, limit):
    integrator = f'<integrator type="taxel_path"> {limit} </integrator>'
    scene = write(CELL, mesh='<float name="mesh_size" value="3"/>', integrator=integrator)
    scene = Scene.from_file(scene.source, fz=0)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    powers = {}
    for method in (TRACER, STOCK):
        estimate = estimator(method, scene, elsewhere, 0.0)
        powers[method] = np.array([estimate(1 << 14, seed).power[0] for seed in range(8)])
    mean, error = ({m: f(p) for m, p in powers.items()} for f in (np.mean, stats.sem))
    agree(mean[STOCK], error[STOCK], mean[TRACER], error[TRACER], replicates=8)
    expected = measure(scene, points=1024, mechanics_error=False)
    agree(mean[TRACER], error[TRACER], expected.power, expected.standard_error, replicates=8)
    if limit:
        with pytest.raises(InputError, match="limits the number of reflections"):
            estimator(ANALOG, scene, elsewhere, 0.0)


def test_files_beside_a_scene_are_found(write, tmp_path):
    (tmp_path / "response.csv").write_text("0, 1\n30, 0.5\n60, 0\n")
    response = '<string name="response" value="tabulated"/> <string name="file" value="response.csv"/>'
    scene = write(PLATE, response=response)
    (tmp_path / "elsewhere").mkdir()
    found = estimator(TRACER, scene, tmp_path / "elsewhere", 0.0)(1 << 10, 3)
    expected = measure(
        write(PLATE, response=response, integrator='<integrator type="taxel_tracer"/>'), points=32, seed=3
    )
    assert np.array_equal(found.power, expected.power) and np.array_equal(found.stated, expected.standard_error)
    assert expected.power < 0.9 * measure(write(PLATE), points=32, seed=3).power


@pytest.mark.parametrize("kept", [None, "somewhere"])
def test_from_nothing_leaves_everything_as_it_was(monkeypatch, tmp_path, kept):
    monkeypatch.delenv("MITSUBA_TAXEL_CACHE", raising=False)
    if kept:
        monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / kept))
    folder = cache.folder()
    with pytest.raises(KeyError), from_nothing():
        inside = cache.folder()
        assert inside != folder and not any(inside.iterdir())
        assert path.shared.cache_info().currsize == loaded_pad.cache_info().currsize == 0
        raise KeyError
    assert (
        cache.folder() == folder
        and not inside.exists()
        and os.environ.get("MITSUBA_TAXEL_CACHE", "") == (str(tmp_path / kept) if kept else "")
    )


def test_a_pads_mechanics_and_chain_are_judged_by_small_elements(clockwork, write, tmp_path, monkeypatch):
    clockwork(TRACER, PATH)
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "cache"))
    for module, name, value in (
        (accuracy_mechanics, "COARSEST", 5.0),
        (accuracy_mechanics, "POINTS", 512),
        (accuracy_chain, "POINTS", 512),
        (accuracy_mechanics, "TOLERANCES", (1e-2,)),
        (accuracy_mechanics, "STRICT", 1e-5),
        (accuracy_chain, "TARGETS", (0.05,)),
    ):
        monkeypatch.setattr(module, name, value)
    curves = accuracy(Scene(write(CELL).source, {"fz": -4}, 1.8), tmp_path / "out", 0.05)
    found = {curve.method: curve for curve in curves}
    assert list(found)[2:] == ["element size", "step tolerance", "reading", "slope over fz"]
    sizes = found["element size"].points
    assert [point.setting for point in sizes] == ["5 mm", "3.54 mm"]
    assert sizes[1].reference == "elements of 1.8 mm, extrapolated"
    assert "elements of 2.5 mm left out" in found["element size"].remark
    assert all(0 < point.floor < point.error < 0.1 for point in sizes)
    (steps,) = found["step tolerance"].points
    assert steps.error < 1e-3 and math.isnan(steps.stated)
    for point in found["reading"].points:
        assert point.error < 4 * math.hypot(point.stated, point.floor)
        assert point.stated == pytest.approx(
            math.hypot(*(point.shares[f"stated_{n}"] for n in ("light", "mechanics", "geometry")))
        )
        assert point.shares["mechanics_error"] > 0 and point.shares["mechanics_seconds"] > 0
        assert point.error <= point.shares["light_error"] + point.shares["mechanics_error"] + 1e-12
    for point in found["slope over fz"].points:
        assert point.error < 4 * math.hypot(point.stated, point.floor) and 0 < point.stated < 1
    with (tmp_path / "out" / "accuracy.csv").open(newline="") as stream:
        parts = {row["part"] for row in csv.DictReader(stream)}
    assert parts == {"optics", "mechanics", "chain"}


@pytest.mark.parametrize(("of_half", "judge"), [(100_000, 1.25 / 2), (300_000, 1.25)])
def test_the_reference_has_half_the_smallest_size_where_so_many_elements_fit(monkeypatch, of_half, judge):
    """However many there are at that size: on walls with smaller ones they are fewer than eight times as many."""
    solved = accuracy_mechanics.UncachedReadings(readings=None, seconds=1.0, elements=60_000)
    monkeypatch.setattr(accuracy_mechanics, "solve", lambda scene, pads, size: solved)
    monkeypatch.setattr(accuracy_mechanics, "_elements", lambda pads, size: of_half if size > 0.6 else 300_000)
    found = accuracy_mechanics.size_runs(None, [], 100.0, lambda words: None)
    assert found.judge == pytest.approx(judge) and "smallest for the memory" in found.ended
    assert min(found.solved) >= 1.1 * judge


def test_solutions_kept_do_not_help(write, monkeypatch, tmp_path):
    scene = write(CELL)
    solved = []
    real = load_segment.LoadSegment.extend
    monkeypatch.setattr(load_segment.LoadSegment, "extend", lambda *arguments: solved.append(1) or real(*arguments))
    monkeypatch.setattr(accuracy_mechanics, "POINTS", 256)
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "cache"))
    pads = open_pads(prepare(scene.with_mesh_size(3.6)).scene, 3.6)
    counts = []
    for _ in range(2):
        solved.clear()
        run = solve(scene, pads, 3.6)
        counts.append(len(solved))
    assert counts[0] == counts[1] > 0 and run.seconds > 0 and run.elements > 10


def test_a_pad_whose_mesh_is_given_cannot_be_compared(write, tmp_path, monkeypatch):
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(bench_accuracy, "optics_curves", lambda *arguments: ([line(-0.5)], None))
    scene = write(CELL, mesh='<float name="mesh_size" value="3.6"/>')
    curves = accuracy(scene, tmp_path / "out", 0.01)
    assert [curve.part for curve in curves] == ["optics", "mechanics", "chain"]
    assert all("fixes the mesh size" in curve.remark and not curve.points for curve in curves[1:])


@pytest.mark.parametrize(
    "values, expected",
    [({}, ("fz", -0.05)), ({"fz": 0, "fx": 2}, ("fx", 0.1)), ({"fz": 0}, None)],
)
def test_the_load_nearby(write, values, expected):
    scene = Scene.from_file(write(CELL).source, **values)
    near = near_load(scene)
    assert (near and (near.force, pytest.approx(near.step))) == expected
    if near:
        assert float(near.scene.parameters[near.force]) == pytest.approx(0.95 * float(scene.parameters[near.force]))


def test_a_slope_in_the_limit_keeps_the_sign_of_its_extrapolation():
    limit = accuracy_mechanics.FineMeshLimit(np.array([[3.0, 2.0], [3.2, 2.2]]), np.array([0.1, -0.1]), 0.5)
    near = accuracy_mechanics.FineMeshLimit(np.array([[1.0, 1.0], [1.2, 1.2]]), np.array([0.08, 0.1]), 0.5)
    truth = accuracy_chain.slope_limit(limit, near, 2.0).truth
    assert truth.power == pytest.approx([1.0, 0.5]) and truth.error == pytest.approx([0.01, 0.1])


@pytest.mark.usefixtures("painted_figures")
def test_plots_show_points_that_cannot_be_claimed(tmp_path):
    shown = line(-0.5)
    hidden = replace(shown, method="other", points=[replace(p, floor=1.0, stated=math.nan) for p in shown.points])
    zero = replace(shown, part="mechanics", points=[replace(p, error=0.0) for p in shown.points])
    empty = ErrorCurve("chain", "", [], remark="no pad")
    plot_accuracy([shown, hidden, zero, empty], "scene", tmp_path)
    with Image.open(tmp_path / "accuracy.png") as image:
        assert image.width > 1000
    write_csv([hidden, empty], tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows[0]["stated_error"] == "" and rows[-1]["remark"] == "no pad" and rows[-1]["error"] == ""
    assert dict(zip(HEADINGS, cells(hidden), strict=True))["error"] == "< 1"


def test_the_title_says_what_is_not_the_default():
    assert title(Scene.from_file("plate.xml", z=0.5)) == "plate.xml, z = 0.5"
    assert title(Scene.from_file("plate.xml")) == "plate.xml"


def test_the_command_prints_a_row_for_each_method(clockwork, tmp_path):
    from taxel_cli.evidence.bench import command

    clockwork(TRACER, PATH)
    out = tmp_path / "out"
    done = CliRunner().invoke(command, ["accuracy", "plate.xml", "-o", str(out), "--seconds", "0.05"])
    assert sorted(os.listdir(out)) == ["accuracy.csv", "accuracy.png", "accuracy.svg"]
    assert done.exit_code == 0 and "optics 2/2: taxel_path" in done.stderr
    rows = done.stdout.splitlines()
    assert [row.split()[:2] for row in rows[1:4]] == [
        ["optics", "taxel_tracer"],
        ["optics", "taxel_path"],
        ["mechanics", "-"],
    ]
    assert "Radiance, raysect" in rows[-1] and "taxel bench peers optics" in rows[-1]


@pytest.mark.parametrize(
    "words, culprit",
    [
        (["plate.xml"], "-o"),
        (["plate.xml", "-o", "out", "--seconds", "0"], "--seconds"),
        (["plate.xml", "-o", "out", "--seconds", "nan"], "seconds = nan"),
        (["plate.xml", "-o", "out", "-D", "zz=1"], "zz"),
        (["nowhere.xml", "-o", "out"], "nowhere.xml"),
        (["plate.xml", "-o", "taken"], "taken"),
        (["dark.xml", "-o", "out"], "0 LEDs"),
    ],
)
def test_bad_requests(tmp_path, monkeypatch, words, culprit):
    from taxel_cli.evidence.bench import command

    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").touch()
    (tmp_path / "dark.xml").write_text('<scene version="3.9.0"> <integrator type="taxel_tracer"/> </scene>')
    done = CliRunner().invoke(command, ["accuracy", *words])
    assert done.exit_code == 2 or isinstance(done.exception, InputError)
    assert culprit in (done.stderr if done.exit_code == 2 else str(done.exception))


def test_every_method_has_a_name_of_its_own():
    names = [method.name for method in METHODS]
    assert len(set(names)) == len(names) and "path (multijitter)" in names
