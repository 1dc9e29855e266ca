"""Sweeps of real scenes, small ones."""

from __future__ import annotations

import json
import os
import re

import numpy as np
import pandas
import pytest
import xarray as xr

from mitsuba_taxel import ComputationError, InputError, measure, open_study, sweep
from mitsuba_taxel.sensing import Scene, find_scene
from mitsuba_taxel.studies import deform, stage_totals, study_error_budget
from mitsuba_taxel.studies.run import job

PLATE = {"scattering": "lambertian", "hole": "0"}


@pytest.fixture(scope="module")
def plate_study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies") / "plate"
    vary = {"z": "0.6:0.8:0.1", "law": "lambertian,uniform_solid_angle"}
    done = []
    result = sweep("plate.xml", vary, PLATE, points=256, seed=5, output=folder, progress=done.append)
    assert [(at.done, at.failed, at.total) for at in done] == [(i, 0, 6) for i in range(1, 7)]
    assert done[-1].error == pytest.approx(float((result.standard_error / result.power).max()))
    return result, folder


def test_readings_are_those_of_single_scenes(plate_study):
    result, _ = plate_study
    assert dict(result.sizes) == {
        "z": 3,
        "law": 2,
        "replicate": 32,
        "taxel": 1,
        "stage": result.sizes["stage"],
    }
    alone = measure(Scene.from_file("plate.xml", z="0.7", law="lambertian", **PLATE), points=256, seed=5)
    there = result.sel(z=0.7, law="lambertian")
    np.testing.assert_allclose(there.replicate_power, alone.replicates, rtol=1e-6)
    np.testing.assert_allclose(there.power, alone.power, rtol=1e-6)
    np.testing.assert_allclose(there.standard_error, alone.standard_error, rtol=1e-4)


def test_neighbours_share_their_random_numbers(plate_study):
    result, _ = plate_study
    at = result.replicate_power.sel(law="lambertian").squeeze("taxel")
    assert np.corrcoef(at.sel(z=0.6), at.sel(z=0.7))[0, 1] > 0.7  # 0 +- 0.18 if they did not


def test_units_and_provenance(plate_study):
    result, _ = plate_study
    assert result.power.units == result.standard_error.units == "W" and result.z.units == "mm"
    assert result.seconds.units == "s" and "units" not in result.law.attrs
    assert result.attrs["seed"] == 5 and result.attrs["points"] == 256 and result.attrs["scene"] == "plate.xml"
    parameters = json.loads(result.attrs["parameters"])
    assert parameters["hole"] == "0" and parameters["width"] == "4" and "z" not in parameters
    assert {"mitsuba", "mitsuba_taxel", "numpy"} <= set(json.loads(result.attrs["versions"]))
    assert stage_totals(result)["optics"] == pytest.approx(float(result.seconds.sel(stage="optics").sum()))


def test_files_hold_the_study(plate_study):
    result, folder = plate_study
    assert {"power.png", "power.svg", "readings.csv", "readings.nc", "study.toml"} <= set(os.listdir(folder))
    with xr.open_dataset(folder / "readings.nc") as kept:
        xr.testing.assert_identical(kept.load().drop_vars("law"), result.drop_vars("law"))
        assert list(kept.law.values) == list(result.law.values)
    lines = (folder / "readings.csv").read_text().splitlines()
    comments = [line for line in lines if line.startswith("# ")]
    heading, *rows = lines[len(comments) :]
    assert heading == "z_mm,law,taxel,power_W,standard_error_W,total_error_W" and len(rows) == 6
    assert "# seed: 5" in comments
    assert float(rows[0].split(",")[3]) == float(result.power[0, 0, 0])


def test_target_error_is_met_along_the_curve(tmp_path):
    result = sweep("plate.xml", {"z": [0.5, 1, 2]}, PLATE, target_error=0.001)
    assert float((result.standard_error / result.power).max()) < 0.001
    assert stage_totals(result)["optics"] > float(result.seconds.sel(stage="optics").sum())


@pytest.mark.parametrize(
    "vary, options, culprit",
    [
        ({}, {}, "nothing is varied"),
        ({"zz": "1,2"}, {}, "zz"),
        ({"z": "1,2"}, {"defines": {"z": 1}}, "both"),
        ({"z": "1,2"}, {"target_error": 0.0}, "target_error"),
        ({"z": "1,2"}, {"target_error": float("nan")}, "target_error"),
        ({"z": "1,2"}, {"target_error": 0.1, "points": 64}, "target_error"),
        ({"law": "silent,loud"}, {"points": 64}, "law=silent: .*silent"),
        ({"law": "silent,loud"}, {}, "law=silent: .*silent"),
        ({"z": "1,2"}, {"workers": 0}, "workers = 0"),
        ({"z": "1,2"}, {"workers": 1, "scheduler": "tcp://127.0.0.1:1"}, "exclude"),
        ({"z": "1,2"}, {"scheduler": "nonsense://here"}, "scheduler = 'nonsense://here'"),
    ],
)
def test_refused(vary, options, culprit):
    with pytest.raises(InputError, match=culprit):
        sweep("plate.xml", vary, **options)


def test_failed_scene_is_named(monkeypatch):
    def fail(*_, **__):
        raise ComputationError("the pad buckles")

    monkeypatch.setattr(job, "measure", fail)
    with pytest.raises(ComputationError, match="z=0.7, hole=0: the pad buckles"):
        sweep("plate.xml", {"z": "0.7", "hole": "0"}, points=64)


def test_others_go_on_where_one_fails():
    result = sweep("plate.xml", {"law": "lambertian,loud,uniform_solid_angle"}, points=64)
    assert np.isnan(result.power.sel(law="loud")).all() and np.isnan(result.standard_error.sel(law="loud")).all()
    assert (result.power.sel(law=["lambertian", "uniform_solid_angle"]) > 0).all()
    (line,) = result.attrs["failures"].splitlines()
    assert line.startswith("law=loud: law = 'loud' is not allowed")


def test_parameters_that_go_together(tmp_path):
    rows = {"z": "0.6,0.7", "spacing": [0.7, 0.9]}
    result = sweep("plate.xml", {}, PLATE, together=rows, points=64, output=tmp_path / "out", parquet=True)
    assert result.power.dims == ("step", "taxel")
    assert result.z.dims == ("step",) and result.z.values.tolist() == [0.6, 0.7] and result.spacing.units == "mm"
    alone = measure(Scene.from_file("plate.xml", z="0.7", spacing="0.9", **PLATE), points=64)
    np.testing.assert_array_equal(result.replicate_power.sel(step=2), alone.replicates)
    table = pandas.read_parquet(tmp_path / "out" / "readings.parquet")
    columns = ["step", "z_mm", "spacing_mm", "taxel", "power_W", "standard_error_W", "total_error_W"]
    assert list(table.columns) == columns
    np.testing.assert_array_equal(table.power_W, result.power.squeeze("taxel"))
    xr.testing.assert_identical(open_study(tmp_path / "out"), result)


def test_maps_lie_beside_the_results(tmp_path):
    import OpenEXR

    result = sweep("plate.xml", {"z": "0.6,0.7"}, PLATE, points=64, output=tmp_path / "out", maps=True)
    assert result["map"].values.tolist() == ["maps/000000.exr", "maps/000001.exr"]
    with OpenEXR.File(str(tmp_path / "out" / "maps" / "000001.exr")) as image:
        mean = image.channels()["irradiance"].pixels.mean()
    assert mean * 0.52 * 0.3 == pytest.approx(float(result.power.sel(z=0.7)[0]), rel=1e-5)


def test_maps_of_a_study_that_grows_stay_with_their_scenes(tmp_path):
    """A value in between gives the last scene another number, and more points compute all maps anew."""
    import OpenEXR

    for values, points in (("0.6,0.8", 64), ("0.6,0.7,0.8", 64), ("0.6,0.7,0.8", 256)):
        result = sweep("plate.xml", {"z": values}, PLATE, points=points, output=tmp_path / "out", maps=True)
        assert result["map"].values.tolist() == [f"maps/{number:06d}.exr" for number in range(len(result.power))]
        for name, power in zip(result["map"].values, result.power.values, strict=True):
            with OpenEXR.File(str(tmp_path / "out" / name)) as image:
                mean = image.channels()["irradiance"].pixels.mean()
            assert mean * 0.52 * 0.3 == pytest.approx(float(power[0]), rel=1e-5)


def test_pad_study_writes_one_mesh_for_each_state_of_the_pad(tmp_path):
    vary = {"fz": "0,-1", "scattering": "isotropic,lambertian"}
    result = sweep("pad.xml", vary, points=64, output=tmp_path / "out")
    (rest, also_rest), (pressed, also_pressed) = result.mesh.values.tolist()
    assert rest == also_rest and pressed == also_pressed and rest != pressed
    assert {f"meshes/{name}" for name in os.listdir(tmp_path / "out" / "meshes")} == {rest, pressed}
    assert result.attrs["notes"].count("mechanics: error of the roofs") == 1
    assert np.all(result.roof_error.sel(fz=0) == 0)
    assert np.all(result.roof_error.sel(fz=-1) > 0) and np.all(result.slope_error.sel(fz=-1) > 0)
    summary = (tmp_path / "out" / "summary.csv").read_text().splitlines()
    assert len(summary) == 1 + 2 * 9
    assert summary[0].startswith("force,scattering,taxel,max_slope_W_per_N,max_slope_error_W_per_N")


@pytest.fixture
def one_cell(tmp_path):
    """A scene of one cell, whose mesh is open, under fz."""
    text = find_scene("pad.xml").read_text()
    text = text.replace('<integer name="rows" value="3"/>', '<integer name="rows" value="1"/>')
    text = text.replace('<integer name="columns" value="3"/>', '<integer name="columns" value="1"/>')
    cells = '<string name="cell" value="$cell"/> <integer name="rows" value="1"/> <integer name="columns" value="1"/>'
    text = text.replace('<string name="cell" value="$cell"/>', cells)
    (tmp_path / "one.xml").write_text(text)
    return tmp_path / "one.xml"


def test_total_errors_of_a_curve(one_cell, tmp_path):
    """Found out at five places; between them the share of the power goes on straight lines."""
    study = sweep(one_cell, {"fz": "0:-4:-0.5"}, points=256, seed=3)
    share = (study.deviation / study.power).squeeze("taxel")
    assert float(share[0]) == 0 and np.all(share[1:] != 0)
    np.testing.assert_allclose(share[1::2], (share[:-1:2].values + share[2::2].values) / 2, rtol=1e-9)
    scene = Scene.from_file(one_cell, fz=-3)
    there, alone = study.sel(fz=-3).squeeze("taxel"), measure(scene, points=256, seed=3)
    assert float(there.deviation) == pytest.approx(alone.deviation[0], rel=1e-6)
    assert float(there.total_error) == pytest.approx(alone.total_error[0], rel=1e-6)
    budget = study_error_budget(study)
    assert budget["total"] == pytest.approx(float((study.total_error / study.power).max()))
    assert 0 < budget["mechanics"] < budget["total"]


def test_rows_after_one_that_fails_are_computed_and_it_is_named(one_cell, error_unknown_here):
    """Of rows taken together, one is refused, and one lies beyond the end of a load path that others share."""
    rows = {"fz": [-0.5, -5000, -1, -1], "law": ["lambertian", "lambertian", "loud", "lambertian"]}
    errors = []
    study = sweep(one_cell, {}, together=rows, points=64, mesh_size=3.0, progress=lambda at: errors.append(at.error))
    assert np.isnan(errors[-1])  # unknown errors of the finite elements are not shown as small ones
    assert np.isnan(study.power[[1, 2]]).all() and (study.power[[0, 3]] > 0).all()
    ends, refused = study.attrs["failures"].splitlines()
    assert ends.startswith("fz=-5000, law=lambertian: ") and "the load path ends at" in ends
    assert refused.startswith("fz=-1, law=loud: law = 'loud' is not allowed")


def test_a_target_chooses_one_mesh_for_all_scenes_and_keeps_it(one_cell, tmp_path):
    request = {"target_error": 0.0045, "output": tmp_path / "out"}
    study = sweep(one_cell, {"fz": "0,-2,-4"}, **request)
    assert study.attrs["mesh_size"] < 1.25 and study_error_budget(study)["total"] <= 0.0045
    again = sweep(one_cell, {"fz": "0,-2,-4"}, **request)
    xr.testing.assert_identical(study, again)
    xr.testing.assert_identical(open_study(tmp_path / "out"), study)
    same = sweep(one_cell, {"fz": "0,-2,-4"}, mesh_size=study.attrs["mesh_size"])
    np.testing.assert_array_equal(study.replicate_power, same.replicate_power)


def test_a_time_budget_limits_points():
    request = {"target_error": 1e-4, "seed": 2}
    short, free = (sweep("plate.xml", {"z": "0.6,0.7"}, PLATE, time_budget=left, **request) for left in (1e-3, 600))
    assert short.attrs["points"] == 256 < free.attrs["points"]
    assert study_error_budget(free)["total"] < 1.5e-4
    with pytest.raises(InputError, match="points and time_budget exclude each other"):
        sweep("plate.xml", {"z": "0.6,0.7"}, points=64, time_budget=1)


@pytest.mark.parametrize("request_", [{"derivatives": ["fz"]}, {"target_slope": 0.1}, {"vary": {"fz": "0:-2"}}])
def test_a_time_budget_has_no_derivatives(one_cell, request_):
    with pytest.raises(InputError, match="time_budget and derivatives .* exclude each other"):
        sweep(one_cell, **{"vary": {"fz": "0,-2"}, "time_budget": 1, **request_})


def test_a_time_budget_limits_the_mesh(one_cell):
    study = sweep(one_cell, {"fz": "-2,-4"}, target_error=1e-4, time_budget=1e-3)
    assert "mesh_size" not in study.attrs
    assert study.attrs["points"] == 0  # light without random numbers is at hand, and better than few paths


def test_written_mesh_gives_the_reading_of_its_pad(tmp_path):
    (row,) = deform("pad.xml", {"fz": -10}, tmp_path)
    assert (row["quantity"], row["value"], row["unit"]) == ("force", [0, 0, -10], "N")
    assert row["stable"] and row["imbalance"] < 1e-4 and 0 < row["roof_error_mm"] < 0.01
    assert 0 < row["min_jacobian"] < 1 and 0 < row["residual"] < 1e-4
    pad = Scene.from_file("pad.xml", fz=-10)
    lines = [line for line in pad.source.read_text().splitlines() if "<default" not in line]
    text = re.sub(r"\$(\w+)", lambda match: pad.parameters[match[1]], "\n".join(lines))
    body = re.search(r'<shape type="deformable_pad">.*?(<bsdf.*?)</shape>', text, re.DOTALL)
    ply = f'<string name="filename" value="{row["file"]}"/> <boolean name="face_normals" value="true"/>'
    (tmp_path / "scene.xml").write_text(text.replace(body[0], f'<shape type="ply"> {ply} {body[1]} </shape>'))
    read, own = (
        measure(scene, points=256, mechanics_error=False) for scene in (Scene.from_file(tmp_path / "scene.xml"), pad)
    )
    np.testing.assert_allclose(read.replicates, own.replicates, rtol=1e-5)


def test_an_interrupt_that_a_library_wraps_is_no_failure_of_a_job(monkeypatch):
    """Dr.Jit does so where it falls into the recording of a kernel; the study must end, and not go on without it."""

    def interrupted(*arguments, **keywords):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise RuntimeError("the kernel could not be compiled") from error

    monkeypatch.setattr(job, "measure", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sweep("plate.xml", {"z": "0.6,0.7"}, points=64)
