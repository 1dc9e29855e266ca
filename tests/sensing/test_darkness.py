"""What a reading of 0 states, beside powers that quadrature knows."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from plate_reference import image_power
from plate_scenes import plate
from taxel_program import run_program

from mitsuba_taxel import crosstalk, measure, open_study, sweep
from mitsuba_taxel.studies.store.dataset import missed_target, study_error_budget

LAW = "uniform_solid_angle"


def dark_share(z: float, integrator: str, points: int) -> float:
    """Share of 640 readings of a mirror from as many paths that are 0."""
    scene = plate(z=z, scattering="mirror", integrator={"type": integrator}, width=100 * z)
    readings = [measure(scene, points=points, seed=seed, mechanics_error=False) for seed in range(20)]
    return float(np.mean([reading.replicates == 0 for reading in readings]))


@pytest.mark.parametrize(("z", "points"), [(0.7, 256), (3.0, 2048)])
def test_rays_that_are_counted_miss_as_often_as_the_stated_error_says(llvm_mono, z, points):
    """Of n rays that bring 1 W or nothing, p W on average, none arrives with a probability of exp(-n p)."""
    expected = math.exp(-points * image_power(z, LAW))
    assert 0.02 < expected < 0.5
    assert dark_share(z, "analog_tracer", points) == pytest.approx(
        expected, abs=4 * math.sqrt(expected * (1 - expected) / 640)
    )


def test_of_one_standard_deviation_it_is_seen_five_times_in_six(llvm_mono):
    reading = measure(plate(z=1e-5, scattering="mirror", integrator={"type": "analog_tracer"}), points=256)
    assert reading.power[0] == 0
    assert math.exp(-32 * 256 * reading.standard_error[0]) == pytest.approx(0.1587, abs=1e-4)


@pytest.mark.parametrize(("z", "points"), [(3.0, 16384), (12.0, 1 << 18)])
def test_guided_paths_miss_less_often_than_the_stated_error_says(llvm_mono, z, points):
    """At the power that is stated, a fifth of the paths, those drawn as the LED shines, would find it as often."""
    scene = plate(z=z, scattering="mirror", width=100 * z)
    power, stated = image_power(z, LAW), 1.841 * 5 / points
    assert 0.2 * power < stated < 5 * power
    readings = measure(scene, points=points, seed=1)
    assert np.mean(readings.replicates == 0) <= 0.1587


def test_more_paths_are_traced_where_the_first_find_none(llvm_mono, agree):
    """A mirror 50 mm away sends 2 uW of 1 W back, which 256 points do not find."""
    scene = plate(z=50.0, scattering="mirror", width=200.0)
    few, power = measure(scene, points=256), image_power(50.0, LAW)
    assert few.power[0] == 0 and few.standard_error[0] > power
    assert few.relative_error == few.error_budget["total"] == math.inf
    found = measure(scene, target_error=0.4, seed=2)
    assert found.points > 1024 and 0 < found.relative_error < 0.6
    agree(found.power, found.standard_error, [power])


@pytest.mark.parametrize("change", [{"power": 0.0, "scattering": "mirror"}, {"scattering": "absorbing"}])
def test_what_cannot_be_lit_reads_nothing_exactly(llvm_mono, change):
    reading = measure(plate(**change), target_error=0.01)
    assert reading.points == 256 and reading.power[0] == reading.total_error[0] == reading.relative_total_error == 0
    assert reading.notes == ["no light found on taxel 1"]


@pytest.mark.parametrize(
    "integrator", [{"type": "taxel_tracer", "strategy": "connections"}, {"type": "taxel_path"}, {"type": "path"}]
)
def test_where_paths_bound_nothing_the_error_is_unknown(llvm_mono, integrator):
    reading = measure(plate(cone_angle=1.0, scattering="mirror", integrator=integrator), points=256)
    assert reading.power[0] == 0 and np.isnan(reading.total_error[0])
    assert "no light found on taxel 1: how much was missed is unknown" in reading.notes


def test_crosstalk_that_was_not_found_has_an_error(llvm_mono):
    """Of two LEDs 30 mm apart, close under one plate: what comes from one to the other is not found."""
    scene = plate(z=0.1, scattering="mirror", columns=2, pitch=30.0, width=100.0)
    matrix = crosstalk(scene, points=256, seed=1)
    away = ~np.eye(2, dtype=bool)
    assert np.all(matrix.power[away] == 0)
    np.testing.assert_allclose(matrix.standard_error[away], 5 * 1.841 / (32 * 256))


def test_a_study_keeps_what_its_dark_readings_may_have_missed(llvm_mono, tmp_path):
    study = sweep("plate.xml", {"z": "1e-5,0.7"}, output=tmp_path, points=256)
    assert study.power[0, 0] == 0 and study.standard_error[0, 0] == pytest.approx(5 * 1.841 / (32 * 256))
    assert study_error_budget(open_study(tmp_path))["total"] == math.inf
    told = run_program(tmp_path, "status", tmp_path)
    assert told.returncode == 0 and "unknown" in told.stdout and "inf" not in told.stdout
    (scene,) = json.loads(run_program(tmp_path, "status", tmp_path, "--json").stdout)["scenes"]
    assert scene["error"] is None
    again = sweep("plate.xml", {"z": "1e-5,0.7"}, output=tmp_path, points=256)
    assert again.standard_error.equals(study.standard_error)


def test_a_failed_reading_leaves_the_budget_of_a_study_alone(llvm_mono):
    lit = sweep("plate.xml", {"z": "0.6,0.7"}, points=256)
    failed = lit.copy(deep=True)
    for name in ("power", "standard_error", "total_error", "replicate_power"):
        failed[name][1] = math.nan
    assert study_error_budget(failed) == pytest.approx(study_error_budget(lit.isel(z=[0])))
    assert 0 < study_error_budget(failed)["total"] < 0.1


def test_a_study_counts_taxels_on_which_no_light_was_found():
    power, total = np.array([[1.0, 0.0], [1.0, 2.0]]), np.array([[1e-3, 1e-6], [1e-3, 1e-3]])
    assert missed_target(0.01, power, total) == "target error 0.01 not reached: 1 of 4 readings, the worst unknown"
    assert missed_target(0.01, power, np.where(power > 0, total, 0.0)) == ""
