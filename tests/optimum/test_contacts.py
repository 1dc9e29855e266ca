"""Optimisations of pads that are loaded until they touch something, whose answers are known."""

from __future__ import annotations

import json

import pytest
from one_cell import one_cell
from taxel_program import run_program

from mitsuba_taxel import open_study
from mitsuba_taxel.optimum import optimise

SHAPE = '<float name="height" value="2"/> <float name="cell_height" value="0.6"/> <float name="wall" value="2"/> '
STUDY = """
scene = "low.xml"
[circuit]
supply = 3.3
load_resistance = 1e4
transfer = 0.02
[optimise]
maximise = "{figure}"
evaluations = 3
[optimise.variables]
youngs_modulus = {{ low = 3, high = 6, start = 4 }}
[optimise.loads]
normal = {{ fz = [0, -2] }}
[[optimise.constraints]]
figure = "{constraint}"
least = {least}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A low cell, whose roof meets the package."""
    folder = tmp_path_factory.mktemp("low")
    cell = one_cell(youngs_modulus=4, fz=0).replace("<vector", SHAPE + "<vector", 1)
    (folder / "low.xml").write_text(cell)
    return folder


def jobs(folder):
    return {file: file.stat().st_mtime_ns for file in (folder / "out").rglob("jobs/*.npz")}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """The address of a Dask scheduler with one worker, which gets its jobs by way of a socket."""
    distributed = pytest.importorskip("distributed")
    settings = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": "127.0.0.1:0"}
    settings |= {"protocol": "tcp://", "host": "127.0.0.1", "silence_logs": 50}
    with distributed.LocalCluster(local_directory=str(tmp_path_factory.mktemp("dask")), **settings) as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="module")
def softest(folder, cluster):
    """The most sensitive cell that touches nothing up to 6.8 N, by a run in a process that was ended, and one on a
    cluster that went on."""
    (folder / "soft.toml").write_text(STUDY.format(figure="sensitivity", constraint="first_contact", least=6.8))

    def ended(progress):
        if progress.designs == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimise(folder / "soft.toml", folder / "out", workers=1, progress=ended)
    kept = jobs(folder)
    done = run_program(folder, "optimise", "soft.toml", "-o", "out", "--scheduler", cluster, "--json")
    assert done.returncode == 0, done.stderr
    return kept, json.loads(done.stdout)


def test_a_cell_as_soft_as_its_first_contact_allows(folder, softest):
    """First contacts are proportional to the modulus."""
    _, found = softest
    (modulus,), (goal, contact, saturation) = found["variables"], found["figures"]
    assert contact["before"] > 7.2 and contact["unit"] == "N"
    assert modulus["best"] == pytest.approx(4 * 6.8 / contact["before"], rel=1e-3)
    assert contact["best"] == pytest.approx(6.8, rel=1e-3) and contact["multiplier"] > 0
    assert goal["best"] > goal["before"] and saturation["best"] < 1
    assert f"first contact along normal: {contact['best']:.4g} N, where the pad touches a package" in found["notes"]


def test_no_way_to_a_contact_is_followed_twice(folder, softest):
    """Each is a job, done before the run was ended or after it."""
    kept, found = softest
    assert len(kept) == 2 * 3 and kept.items() <= jobs(folder).items()
    study = open_study(folder / "out" / "designs")
    ways = study.to_contact.values != "none"
    assert ways.sum() == len(found["history"]) and found["load_steps"] == 2 * ways.sum()
    assert set(study.touched.values[ways]) == {"a package"} and set(study.touched.values[~ways]) == {""}


def test_the_longest_range_of_a_sensitive_cell(folder, softest):
    """It ends with first contact here: it is as firm as the sensitivity allows; what was read is reused."""
    _, found = softest
    least = 0.9 * found["figures"][0]["before"]
    (folder / "far.toml").write_text(STUDY.format(figure="range", constraint="sensitivity", least=least))
    before = jobs(folder)
    far = optimise(folder / "far.toml", folder / "out")
    assert before.items() <= jobs(folder).items()
    (modulus,), (goal, sensitivity, saturation) = far.variables.best, far.figures.itertuples()
    assert goal.unit == "N" and goal.best / goal.before == pytest.approx(modulus / 4, rel=1e-3)
    assert goal.before == pytest.approx(found["figures"][1]["before"], rel=1e-9)
    assert sensitivity.best == pytest.approx(least, rel=1e-3) and sensitivity.multiplier > 0
    assert saturation.best < 1
    (note,) = (note for note in far.notes if note.startswith("range along normal"))
    assert note == f"range along normal: {goal.best:.4g} N, where the pad touches a package"
