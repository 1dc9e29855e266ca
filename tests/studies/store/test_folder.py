"""Nothing lost, nothing mixed: studies that are stopped, harmed, gone on with, or begun twice."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from started_process import started

from mitsuba_taxel import ComputationError, InputError, open_study, sweep
from mitsuba_taxel.base.files import atomic, toml
from mitsuba_taxel.studies.run import job
from mitsuba_taxel.studies.store import folder as store
from mitsuba_taxel.studies.store import provenance
from mitsuba_taxel.studies.store.status import study_status

Z = "0.6,0.7,0.8"
RUN = {"points": 64, "seed": 3}


def run(folder, z=Z, **options):
    return sweep("plate.xml", {"z": z}, {"hole": 0}, output=folder, **{**RUN, **options})


def grown_content(folder, further):
    """The content of the study in a folder, with one more value that depends on a number."""
    content = toml.loads((folder / "study.toml").read_text())
    content["vary"]["z"].append(f"{2 + further / 10:g}")
    return content


@pytest.fixture
def counted(monkeypatch):
    """The scenes that are read, one by one."""
    seen = []
    really = job.measure

    def measure(ready, **options):
        seen.append(ready.parameters["z"])
        return really(ready, **options)

    monkeypatch.setattr(job, "measure", measure)
    return seen


@pytest.fixture(scope="module")
def one_finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished") / "out"
    return folder, run(folder)


@pytest.fixture
def finished(tmp_path, one_finished):
    """A folder with a finished study, and the study."""
    folder, study = one_finished
    shutil.copytree(folder, tmp_path / "out")
    return tmp_path / "out", study


def test_a_finished_study_is_not_computed_again(finished, counted):
    folder, study = finished
    xr.testing.assert_identical(run(folder), study)
    xr.testing.assert_identical(open_study(folder), study)
    assert counted == []


@pytest.mark.parametrize("harm", ["truncated", "flipped", "emptied", "pickled", "another's", "removed"])
def test_a_damaged_result_is_computed_again(finished, counted, harm):
    folder, study = finished
    file = folder / "jobs" / "000001.npz"
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    harmed = {
        "truncated": file.read_bytes()[:-9],
        "flipped": bytes(content),
        "emptied": b"",
        "pickled": b"\x80\x04cos\nsystem\n(S'true'\ntR.",
        "another's": (folder / "jobs" / "000002.npz").read_bytes(),
    }
    file.unlink() if harm == "removed" else file.write_bytes(harmed[harm])
    assert np.isnan(open_study(folder).power.sel(z=0.7)).all()
    xr.testing.assert_identical(run(folder).drop_vars("seconds"), study.drop_vars("seconds"))
    assert counted == ["0.7"]


def test_an_interrupted_study_goes_on(tmp_path, counted):
    folder = tmp_path / "out"

    def stop(progress):
        if progress.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(folder, progress=stop)
    (state,) = study_status(folder)
    assert (state.done, state.failed, state.total, state.running) == (2, 0, 3, False)
    assert int(open_study(folder).power.notnull().sum()) == 2
    counted.clear()
    again = run(folder)
    assert counted == ["0.8"] and again.power.notnull().all()


def test_a_study_that_is_killed_loses_the_jobs_in_flight_at_most(tmp_path):
    """At any moment: several times, and what is there in the end is what one undisturbed run gives, to the bit."""
    folder, count = tmp_path / "out", 12
    z = ",".join(str(0.5 + 0.05 * i) for i in range(count))
    call = f"sweep('plate.xml', {{'z': '{z}'}}, {{'hole': 0}}, points=64, seed=3, output=r'{folder}')"
    done = 0
    for _ in range(2):
        command = [sys.executable, "-c", f"from mitsuba_taxel import sweep; {call}"]
        with started(command, stderr=subprocess.DEVNULL) as process:
            while process.poll() is None and len(list(folder.glob("jobs/*.npz"))) < done + 2:
                time.sleep(0.002)
        left = len(list(folder.glob("jobs/*.npz")))
        assert left >= done
        done = left
    assert done > 0
    study = run(folder, z)
    np.testing.assert_array_equal(
        study.replicate_power, sweep("plate.xml", {"z": z}, {"hole": 0}, **RUN).replicate_power
    )
    assert not list(folder.glob("jobs/.*"))


def test_two_runs_at_once_are_refused(finished):
    folder, _ = finished
    holder = f"""
import sys, filelock
with filelock.FileLock(r"{folder / ".lock"}"):
    print("held", flush=True)
    sys.stdin.read()
"""
    command = [sys.executable, "-c", holder]
    with started(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        with pytest.raises(InputError, match="in use by another run"):
            run(folder)
        assert study_status(folder)[0].running
        process.communicate("")
    run(folder)


@pytest.mark.parametrize(
    "change, complaint",
    [
        ({"seed": 4}, "it has seed = 3 instead of seed = 4"),
        ({"maps": True}, "instead of maps = true"),
    ],
)
def test_another_study_is_refused(finished, change, complaint):
    with pytest.raises(InputError, match=f"holds another study .*{complaint}"):
        run(finished[0], **change)


def test_results_of_other_code_or_another_scene_are_refused(tmp_path, finished, monkeypatch):
    monkeypatch.setattr(provenance, "code_digest", lambda *rooms: "another")
    with pytest.raises(InputError, match="holds another study .*code"):
        run(finished[0])
    assert "another version of the program" in open_study(finished[0]).attrs["notes"]
    monkeypatch.undo()
    assert "another version of the program" not in open_study(finished[0]).attrs["notes"]
    scene = tmp_path / "own.xml"
    from mitsuba_taxel.sensing import find_scene

    scene.write_text(find_scene("plate.xml").read_text())
    sweep(scene, {"z": "0.6"}, output=tmp_path / "own", **RUN)
    plain = scene.read_text()
    for text, said in (
        (plain.replace('name="law" value="uniform_solid_angle"', 'name="law" value="lambertian"'),
         "own.xml has changed since: the <default> law is lambertian instead of uniform_solid_angle"),
        (plain.replace('z="0.5"', 'z="0.6"'), "own.xml has changed since: z of translate is 0.6 instead of 0.5"),
        (plain.replace("<integrator", "<sampler type='owen_sobol'/> <integrator"), "own.xml has changed since: line"),
    ):  # fmt: skip
        assert text != plain
        scene.write_text(text)
        with pytest.raises(InputError, match=re.escape(f"own holds another study ({said}")):
            sweep(scene, {"z": "0.6"}, output=tmp_path / "own", **RUN)


def test_foreign_files_are_not_touched(tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="not empty"):
        run(tmp_path)
    assert [file.name for file in tmp_path.iterdir() if not file.name.startswith(".")] == ["letter.txt"]


def test_what_others_keep_in_the_folders_of_a_study_stays(finished):
    """Hidden files and folders, notes among the jobs: as a study is begun, extended, and repeats what failed."""
    folder, _ = finished
    kept = [
        folder / name / other
        for name in ("jobs", "failed", "meshes", "maps")
        for other in (".git", ".notes", "notes.txt", "notes.json", ".hidden/notes")
    ]
    for file in kept:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("kept")
    own = folder / "meshes" / f"{atomic.PREFIX}{atomic._host()}-{2**22 + 1}-killed.ply"
    own.touch()
    run(folder)
    run(folder, Z + ",0.9", retry_failed=True)
    assert [file.read_text() for file in kept] == ["kept"] * len(kept)
    assert not own.exists() and len(list(folder.glob("jobs/*.npz"))) == 4


def test_a_study_that_is_killed_as_it_grows_is_completed(finished, monkeypatch):
    """At any of the steps that replace its results."""
    folder, _ = finished
    (folder / "jobs" / "notes.txt").write_text("kept")
    really, left = Path.rename, 0
    for killed_at in range(6):
        left = killed_at

        def rename(path, target):
            nonlocal left
            if "out" in path.parts and left == 0:
                raise KeyboardInterrupt
            left -= 1
            return really(path, target)

        monkeypatch.setattr(Path, "rename", rename)
        with contextlib.suppress(KeyboardInterrupt):
            store.Store(folder)._begin(grown_content(folder, killed_at), "")
        monkeypatch.setattr(Path, "rename", really)
        store.Store(folder)._finish_growing()
        assert (folder / "jobs" / "notes.txt").read_text() == "kept"
        assert len(list(folder.glob("jobs/*.npz"))) == 3


@pytest.mark.parametrize("name", ["jobs", "failed", "meshes", "maps", ".growing", ".grown", ".lock"])
def test_links_are_refused_before_anything_is_written(tmp_path, finished, name):
    folder, _ = finished
    elsewhere = tmp_path / "elsewhere"
    if (folder / name).exists() and name != ".lock":
        (folder / name).rename(elsewhere)
    else:
        (folder / name).unlink(missing_ok=True)
        elsewhere.touch() if name == ".lock" else elsewhere.mkdir()
    if elsewhere.is_dir():
        (elsewhere / ".notes").touch()
    else:
        elsewhere.write_text("kept")
    before = sorted(path.name for path in elsewhere.glob("*")), (folder / "study.toml").read_text()
    (folder / name).symlink_to(elsewhere)
    with pytest.raises(InputError, match=rf"output folder .* is not allowed: {name} in it is a link, not a f"):
        run(folder, Z + ",0.9")
    assert (sorted(path.name for path in elsewhere.glob("*")), (folder / "study.toml").read_text()) == before
    assert elsewhere.is_dir() or elsewhere.read_text() == "kept"


def test_what_failed_is_done_again_when_asked(tmp_path, monkeypatch):
    really = job.measure

    def measure(ready, **options):
        if ready.parameters["z"] == "0.7":
            raise ComputationError("no luck")
        return really(ready, **options)

    monkeypatch.setattr(job, "measure", measure)
    first = run(tmp_path / "out")
    assert first.attrs["failures"] == "z=0.7: no luck"
    monkeypatch.undo()
    assert run(tmp_path / "out").attrs["failures"] == "z=0.7: no luck"
    (state,) = study_status(tmp_path / "out")
    assert (state.done, state.failed) == (2, 1)
    again = run(tmp_path / "out", retry_failed=True)
    assert again.attrs["failures"] == "" and again.power.notnull().all()


def test_a_full_disk_stops_cleanly_and_keeps_what_there_is(tmp_path, monkeypatch):
    really = store.replacing

    def replacing(file):
        if file.name == "000001.npz":
            raise OSError(28, os.strerror(28))
        return really(file)

    monkeypatch.setattr(store, "replacing", replacing)
    with pytest.raises(ComputationError, match="No space left on device.*1 jobs are"):
        run(tmp_path / "out")
    monkeypatch.undo()
    assert run(tmp_path / "out").power.notnull().all()


def test_a_folder_without_results_is_refused(tmp_path):
    needed = r"^study .* is not allowed: the output folder .* with study\.toml, is needed\.$"
    with pytest.raises(InputError, match=needed):
        open_study(tmp_path)


def test_progress_of_a_run_is_written_down(finished):
    folder, _ = finished
    about = json.loads((folder / "run.json").read_text())
    assert about["finished_before"] == 0 and about["workers"] == "this process" and about["process"] == os.getpid()
