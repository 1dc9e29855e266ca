"""The total error of a reading: mechanics and light, stated honestly, and reached where a target asks for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel import Pad, PadSensor, Readings, Scene, Wall, measure
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.kernels.surfaces.mesh_adapter import Places, move_vertices
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
from mitsuba_taxel.mechanics.continuation.state import StateComparison
from mitsuba_taxel.sensing import measurement, targets
from mitsuba_taxel.sensing.reading.mechanics_error import combined, mechanics_deviations
from mitsuba_taxel.sensing.reading.readings import mechanics_share
from mitsuba_taxel.sensing.reading.runs import FIRST_POINTS, Clock, Run, prepare
from mitsuba_taxel.sensing.scene.scene_pads import loaded_pads
from mitsuba_taxel.sensing.targets import MOST_RUNGS, RUNG, _powers, _timed, mechanics_of, rungs_to

CELLS = ("parallelepiped", "cylindrical", "spherical", "hemispheric")
FINE = 0.6
"""mm: on it one cell is right to a third of what it is on the default elements."""


def sensor(cell="parallelepiped", force=(0.0, 0.0, -2.0), **parts):
    return PadSensor(pad=Pad(cell, rows=1, columns=1), force=force, **parts).scene()


def test_stated_errors_cover_those_against_fine_meshes_as_often_as_they_say(llvm_mono):
    """One standard deviation: two in three at least, for all shapes and small and large loads; and none is useless.

    By single cells, which have no others to average over: one in eight meshes may agree with its comparison by chance.
    """
    shares = []
    for cell, force in zip(CELLS, (-1.0, -3.0, -1.0, -3.0), strict=True):
        scene = sensor(cell, (0.0, 0.0, force))
        here, fine = measure(scene), measure(scene.with_mesh_size(FINE), mechanics_error=False)
        true, stated = abs(here.power[0] - fine.power[0]), here.mechanics_error[0]
        shares.append(true / stated)
        assert true < 0.003 * here.power[0] and stated < 0.01 * here.power[0]
    assert np.mean(np.array(shares) < 1) >= 2 / 3, shares


def test_a_deviation_is_the_change_of_a_pad_of_that_surface(llvm_mono, agree, tmp_path):
    """Read independently: the displaced surface as a file of its own, with other random numbers."""
    ready = prepare(sensor("hemispheric", (0.0, 0.0, -3.0), roof=Wall("lambertian")))
    (pad,) = (shape for shape in ready.scene.shapes() if hasattr(shape, "state"))
    rest = measure(ready, points=2048, seed=1)
    further = pad.deviating_places()[0].vertices + [0.0, 0.0, 0.05]  # far enough to be seen at once
    move_vertices(pad, Places(further, None))
    pad.write_ply(str(tmp_path / "moved.ply"))
    ready.scene.parameters_changed([])
    moved = measure(ready, points=2048, seed=2, mechanics_error=False)
    description = dict(sensor("hemispheric", roof=Wall("lambertian")).source)
    walls = description["pad"]["bsdf"]
    description["pad"] = {"type": "ply", "filename": str(tmp_path / "moved.ply"), "face_normals": True, "bsdf": walls}
    other = measure(Scene(description), points=2048, seed=3)
    agree(moved.power, moved.standard_error, other.power, other.standard_error)
    assert abs(moved.power[0] - rest.power[0]) > 20 * rest.standard_error[0]


def test_parts_of_an_error_that_take_each_other_back_do_not_cancel(llvm_mono):
    """Roofs that move too little everywhere, and as much too far besides: added up they would do nothing."""
    ready = prepare(sensor())
    (pad,) = loaded_pads(ready.scene)
    further = 0.01 * pad.state.displacement
    pad.state = replace(pad.state, second_mesh=lambda: StateComparison(deviate=lambda: np.array([-further, further])))
    _, changes = mechanics_deviations(ready.scene, lambda: _powers(ready, 1, 1024))
    less, more = changes.mean(axis=1)
    assert less < 0 < more and abs(less + more) < 4 * standard_error(changes.sum(axis=0)) + 0.01 * more
    assert combined(changes.mean(axis=1)) == pytest.approx(-np.hypot(less, more))


def test_a_mesh_is_chosen_that_just_reaches_what_is_wanted():
    for error, order in ((0.011, 1.5), (0.02, 1.5), (0.02, 2.0), (0.03, 1.5)):  # on elements of 1 mm
        rungs = rungs_to(0.01, [(1.0, error)], order)
        assert error * RUNG ** (order * rungs) <= 0.01 < error * RUNG ** (order * (rungs - 1))
    assert rungs_to(0.01, [(1.0, 1.0)]) == rungs_to(0.01, [(1.0, 0.02), (0.8, np.nan)]) == MOST_RUNGS


def test_one_mesh_whose_error_is_large_by_chance_does_not_decide_alone():
    """Twice and half of what the other meshes say: the mean of both is the truth."""
    usual = [(1.0, 0.04), (0.5, 0.04 * 0.5**1.5)]
    scattered = [(1.0, 0.02), (0.5, 0.08 * 0.5**1.5)]
    assert rungs_to(0.01, scattered) == rungs_to(0.01, usual) < rungs_to(0.01, scattered[1:])


def test_a_scene_is_as_before_when_its_error_is_known(llvm_mono):
    ready = prepare(sensor("spherical"))
    before = measure(ready, points=FIRST_POINTS, mechanics_error=False)
    found = mechanics_of(ready, seed=0)
    after = measure(ready, points=FIRST_POINTS, mechanics_error=False)
    assert np.array_equal(before.replicates, after.replicates)
    assert found.deviation[0] != 0 and 0 < found.share < 0.02


def test_a_target_chooses_mesh_and_points(llvm_mono):
    scene, target = sensor("parallelepiped", (0.0, 0.0, -4.0)), 0.0045
    plain, aimed = measure(scene), measure(scene, target_error=target)
    assert plain.mesh_size is None and plain.relative_total_error > target
    assert aimed.mesh_size < 1.25 and aimed.relative_total_error <= target
    assert any(note.startswith(f"finite elements of {aimed.mesh_size:.3g} mm") for note in aimed.notes)
    assert not any("not reached" in note for note in aimed.notes)
    fixed = scene.with_mesh_size(aimed.mesh_size)
    assert np.array_equal(measure(fixed).replicates, aimed.replicates)
    further = measure(scene, points=512, continued=measure(fixed, points=256))
    np.testing.assert_allclose(further.replicates, measure(fixed, points=512).replicates, rtol=1e-12)
    assert further.mesh_size == aimed.mesh_size


def test_where_light_has_no_noise_the_shape_may_take_the_whole_target(llvm_mono):
    scene = sensor("parallelepiped", (0.0, 0.0, -4.0))
    plain = measure(scene, target_error=0.5)
    assert plain.points == 0 and plain.mesh_size is None
    total = plain.relative_total_error
    assert measure(scene, target_error=1.01 * total).mesh_size is None
    finer = measure(scene, target_error=0.99 * total)
    assert finer.mesh_size < 1.25 and finer.relative_total_error <= 0.99 * total


def test_a_mesh_that_the_scene_chose_is_kept_and_what_that_misses_is_said(llvm_mono):
    description = dict(sensor("parallelepiped", (0.0, 0.0, -4.0)).source)
    description["pad"] = {**description["pad"], "mesh_size": 1.25}
    reading = measure(Scene(description), target_error=0.001)
    assert reading.mesh_size is None and reading.relative_error < 0.001
    assert any(
        note.startswith("target error 0.001 not reached: light") and "mechanics" in note for note in reading.notes
    )


def test_a_time_budget_leaves_a_finer_mesh_alone(llvm_mono):
    reading = measure(sensor("cylindrical", roof=Wall("mirror")), target_error=1e-4, time_budget=1e-3)
    assert reading.mesh_size is None and reading.points >= 256


@pytest.mark.parametrize(("cell", "force", "target"), [("hemispheric", 0.0, 1e-5), ("cylindrical", -2.0, 1e-4)])
def test_a_missed_target_returns_no_more_error_than_without_one(llvm_mono, cell, force, target):
    """In this time random paths have an error of half a percent."""
    scene = sensor(cell, (0.0, 0.0, force))
    plain, aimed = measure(scene), measure(scene, target_error=target, time_budget=1e-3)
    assert target < aimed.relative_total_error <= plain.relative_total_error
    assert any(note.startswith(f"target error {target:g} not reached") for note in aimed.notes)


def test_paths_that_end_with_a_larger_error_are_dropped(llvm_mono, monkeypatch):
    """Where the pilot runs expected a smaller one of them."""
    monkeypatch.setattr(targets, "points_for", lambda *args: FIRST_POINTS)
    monkeypatch.setattr(Clock, "allows", lambda clock, seconds: False)
    scene = sensor(force=(0.0, 0.0, 0.0))
    aimed = measure(scene, target_error=1e-5)
    assert aimed.points == 0 and np.array_equal(aimed.power, measure(scene).power)


def test_without_a_load_the_light_may_take_the_whole_target(llvm_mono):
    scene = sensor("cylindrical", (0.0, 0.0, 0.0))
    total = measure(scene).relative_total_error
    aimed = measure(scene, target_error=1.1 * total)
    assert aimed.points == 0 and aimed.mesh_size is None and aimed.relative_total_error == total


def test_a_pilot_run_is_extended(llvm_mono, monkeypatch):
    """It traces as many points as it finds to be needed, not those of all runs before it as well."""
    traced, step = [], Run._step
    monkeypatch.setattr(Run, "_step", lambda run, points: (traced.append(points), step(run, points)))
    found = targets.points_for(prepare(sensor(force=(0.0, 0.0, 0.0), roof=Wall("mirror"))), 0.005)
    assert found > 4 * FIRST_POINTS and sum(traced) == found


def test_elements_that_change_no_light_do_not_ask_for_it_again(llvm_mono, monkeypatch):
    """Without a load."""
    asked, known = [], targets.without_random_numbers
    monkeypatch.setattr(targets, "without_random_numbers", lambda ready: (asked.append(ready), known(ready))[1])
    monkeypatch.setattr(targets, "points_for", lambda *args: FIRST_POINTS)
    monkeypatch.setattr(Run, "extend_to_error", lambda *args: None)
    monkeypatch.setattr(targets, "MOST_MESHES", 1)
    reading = measure(sensor("cylindrical", (0.0, 0.0, 0.0)), target_error=2e-5)
    assert len(asked) == 1 and reading.points == 0


@pytest.mark.parametrize("target", [None, 0.01])
def test_points_are_doubled_where_pilot_runs_found_too_few(llvm_mono, monkeypatch, target):
    few = 16
    for module in (targets, measurement):
        monkeypatch.setattr(module, "points_for", lambda *args: few)
    scene = sensor(force=(0.0, 0.0, 0.0), roof=Wall("mirror"))
    wanted = target or measurement.LIGHT_ERROR
    assert measure(scene, points=few).relative_error > wanted
    reading = measure(scene, target_error=target)
    assert few < reading.points and reading.relative_error <= wanted
    assert measure(scene, points=reading.points // 2).relative_error > wanted
    assert not any("not reached" in note for note in reading.notes)


def test_a_solution_that_was_kept_does_not_make_a_finer_mesh_look_cheap(llvm_mono):
    scene = sensor("cylindrical", (0.0, 0.0, -1.7))
    for _ in range(2):
        ready, seconds = _timed(scene)
        (pad,) = loaded_pads(ready.scene)
        assert seconds >= pad.state.seconds > 0


def test_domes_have_no_floor_of_noise_in_the_error_of_the_mechanics(llvm_mono, monkeypatch):
    """Of few points they have much, whatever the mesh: here so few that not many more tell what is asked for."""
    monkeypatch.setattr(targets, "DEVIATION_POINTS", 16)
    ready = prepare(sensor("hemispheric", (0.0, 0.0, -1.0)))
    few = [mechanics_of(ready, seed, 16).share for seed in range(6)]
    enough = [mechanics_of(ready, seed, 1 << 12, 1e-3).share for seed in range(3)]
    bound = 1e-3 * (1 + 4 / 6**0.5)  # 4 sigma of three; what the error itself, some 1.5e-4, adds is within it
    assert np.sqrt(np.mean(np.square(few))) > bound
    assert np.sqrt(np.mean(np.square(enough))) < bound


def test_no_load_no_error_of_the_mechanics(llvm_mono):
    unloaded = measure(sensor(force=(0.0, 0.0, 0.0)), points=64)
    assert unloaded.deviation is None and np.array_equal(unloaded.total_error, unloaded.standard_error)


def test_elements_so_large_that_twice_as_large_ones_are_the_same_have_an_error(llvm_mono):
    reading, fine = (measure(sensor().with_mesh_size(size), points=1024, seed=1) for size in (20.0, FINE))
    assert abs(reading.power[0] - fine.power[0]) < 2 * reading.total_error[0] < 0.2 * fine.power[0]


@pytest.fixture
def no_second_mesh(monkeypatch):
    """Only meshes as fine as asked for can be loaded."""
    solve = PadPath.canonical

    def refused(path, *args):
        if not path.judged:
            raise ComputationError("the load path ends")
        return solve(path, *args)

    monkeypatch.setattr(PadPath, "canonical", refused)


def test_a_target_asks_for_a_finer_mesh_where_the_error_is_unknown(llvm_mono, no_second_mesh, monkeypatch):
    """The light alone is no total: as long as the mechanics says nothing, the mesh becomes finer."""
    monkeypatch.setattr(targets, "MOST_MESHES", 1)
    reading = measure(sensor("cylindrical", (0.0, 0.0, -0.5)), target_error=0.05)
    assert reading.mesh_size < 0.5 * Pad("cylindrical", 1, 1).default_mesh_size
    assert any("not reached" in note for note in reading.notes)


def test_an_unknown_error_is_said_to_be_unknown(llvm_mono, no_second_mesh):
    reading = measure(sensor(force=(0.0, 0.0, -0.5)), points=64, seed=1)
    assert np.isnan(reading.total_error).all() and np.isnan(reading.error_budget["total"])
    (note,) = (note for note in reading.notes if note.startswith("mechanics error unknown"))
    assert "smaller mesh_size" in note


def test_shares_are_those_of_all_lit_taxels():
    power, deviation = np.array([1.0, 2.0, 0.0]), np.array([0.03, -0.08, 0.0])
    readings = Readings(np.tile(power, (4, 1)), 64, 0, deviation=deviation)
    share = mechanics_share(deviation, power)
    assert share == pytest.approx(np.sqrt((0.03**2 + 0.04**2) / 2) / (2**1.5 - 1))
    np.testing.assert_allclose(readings.mechanics_error, share * power)
    assert readings.error_budget == pytest.approx({"light": 0.0, "mechanics": share, "geometry": 0.0, "total": share})
