"""Studies written in TOML: one scene or several, one of which may be bad."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import InputError, open_study, run_study, sweep
from mitsuba_taxel.studies.plan.batch import batch_from, read_study
from mitsuba_taxel.studies.store.status import study_status

TWO = """
points = 64
seed = 2
[[scenes]]
name = "heights"
scene = "plate.xml"
[scenes.define]
hole = 0
[scenes.vary]
z = "0.6:0.8:0.1"
[[scenes]]
name = "steps"
scene = "plate.xml"
[scenes.together]
z = [0.6, 0.7]
spacing = [0.7, 0.9]
"""
ONE = """
scene = "plate.xml"
points = 64
seed = 2
[define]
hole = 0
[vary]
z = "0.6:0.8:0.1"
"""


def written(folder, text, name="study.toml"):
    file = folder / name
    file.write_text(text)
    return file


def test_a_file_of_one_scene_is_a_sweep(tmp_path):
    study = run_study(written(tmp_path, ONE), tmp_path / "out")
    same = sweep("plate.xml", {"z": "0.6:0.8:0.1"}, {"hole": 0}, points=64, seed=2)
    np.testing.assert_array_equal(study.replicate_power, same.replicate_power)


def test_what_is_written_beside_the_results_runs_again(tmp_path):
    first = run_study(written(tmp_path, ONE), tmp_path / "out")
    again = run_study(tmp_path / "out" / "study.toml", tmp_path / "again")
    xr.testing.assert_identical(first.drop_vars("seconds"), again.drop_vars("seconds"))


def test_several_scenes_are_a_tree(tmp_path):
    tree = run_study(written(tmp_path, TWO), tmp_path / "out", workers=1)
    assert set(tree.children) == {"heights", "steps"} and tree.attrs["failures"] == ""
    assert tree["heights"].power.dims == ("z", "taxel") and tree["steps"].power.dims == ("step", "taxel")
    xr.testing.assert_identical(open_study(tmp_path / "out"), tree)
    assert [(state.name, state.done, state.total) for state in study_status(tmp_path / "out")] == [
        ("heights", 3, 3),
        ("steps", 2, 2),
    ]


def test_one_bad_scene_does_not_stop_the_rest(tmp_path):
    bad = TWO.replace('scene = "plate.xml"', 'scene = "nowhere.xml"', 1)
    tree = run_study(written(tmp_path, bad), tmp_path / "out")
    assert set(tree.children) == {"steps"}
    assert tree.attrs["failures"].startswith("heights: scene 'nowhere.xml' does not exist")
    assert [state.done for state in study_status(tmp_path / "out")] == [0, 2]


def test_files_are_named_relative_to_the_study(tmp_path):
    folder = tmp_path / "there"
    folder.mkdir()
    (folder / "path.csv").write_text("z,spacing\n0.6,0.7\n0.7,0.9\n")
    (folder / "heights.txt").write_text("0.5\n0.6\n")
    text = 'scene = "plate.xml"\nsteps = "path.csv"\n[vary]\nwidth = "@heights.txt"\n'
    batch = batch_from(read_study(written(folder, text)), 0, folder)
    assert [axis.values for axis in batch.axes] == [
        {"width": ["0.5", "0.6"]},
        {"z": ["0.6", "0.7"], "spacing": ["0.7", "0.9"]},
    ]


@pytest.mark.parametrize(
    "text, complaint",
    [
        ("scene = ", "is not valid TOML"),
        ("", "scene is missing"),
        ('scene = "plate.xml"', "nothing is varied"),
        ('scene = "plate.xml"\nsede = 1', "sede is not known"),
        ('scene = "plate.xml"\nvary = 1', "vary = 1"),
        ('scene = "plate.xml"\nseed = "x"\n[vary]\nz = 1', "seed = 'x'"),
        ('scene = "plate.xml"\ntarget_error = "x"\n[vary]\nz = 1', "target_error = 'x'"),
        ('scene = "plate.xml"\npoints = true\n[vary]\nz = 1', "points = True"),
        ('scene = "plate.xml"\nmaps = 1\n[vary]\nz = 1', "maps = 1"),
        ('scene = "plate.xml"\nsteps = "no.csv"', "cannot be read"),
        ("scenes = 1", "scenes"),
        ('[[scenes]]\nname = "../up"', "names = "),
        ('[[scenes]]\nname = "a"\n[[scenes]]\nname = "a"', "distinct names"),
        ('[[scenes]]\nname = "a"\nsene = 1', "sene is not known"),
    ],
)
def test_refused(tmp_path, text, complaint):
    file = written(tmp_path, text)
    with pytest.raises(InputError, match=complaint):
        batch_from(read_study(file), 0, tmp_path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        run_study(tmp_path / "nowhere.toml", tmp_path / "out")
