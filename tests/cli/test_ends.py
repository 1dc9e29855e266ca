"""How the program ends where something outside it goes wrong: in one line, with the right exit code."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from types import SimpleNamespace

import click
import pytest
import taxel_cli
from started_process import interrupted, started

from mitsuba_taxel import InputError, open_study
from mitsuba_taxel.sensing import Scene, find_scene

LONG = ("sweep", "plate.xml", "--vary", "z=0.1:90:0.1", "--points", "4096", "-o", "out")


@contextmanager
def begun(command, folder, **how):
    """A sweep that has kept its first job."""
    with started(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **how) as run:
        while not list(folder.glob("out/jobs/[0-9]*.npz")):
            assert run.poll() is None, run.communicate()
            time.sleep(0.05)
        yield run


def session(leader):
    """Processes of a session that are not ended: zombies are."""
    states = [line.split() for line in subprocess.check_output(["ps", "-eo", "sid,stat"], text=True).splitlines()[1:]]
    return [state for sid, state in states if int(sid) == leader and not state.startswith("Z")]


@pytest.mark.parametrize(
    ("number", "workers", "all_of_them"),
    [
        (signal.SIGTERM, (), False),
        (signal.SIGTERM, ("--workers", "1"), False),
        (signal.SIGHUP, ("--workers", "1"), True),
    ],
)
def test_signals_end_it_and_its_workers_in_one_line(program, tmp_path, number, workers, all_of_them):
    with begun([program, *LONG, *workers], tmp_path, start_new_session=True) as run:
        if all_of_them:
            os.killpg(run.pid, number)  # as a terminal that is closed
        else:
            run.send_signal(number)
        out, err = run.communicate(timeout=60)
    assert (run.returncode, out, err) == (128 + number, "", f"taxel: ended by {number.name}\n")
    deadline = time.monotonic() + 20
    while session(run.pid):  # Python's own that clears up ends by itself
        assert time.monotonic() < deadline
        time.sleep(0.1)
    kept = list(tmp_path.glob("out/jobs/*"))
    assert kept and not any(file.name.startswith(".") for file in kept)


def test_what_was_started_to_outlast_its_terminal_does(program, tmp_path):
    with begun(["nohup", program, *LONG], tmp_path) as run:
        run.send_signal(signal.SIGHUP)
        time.sleep(0.5)
        assert run.poll() is None
        run.terminate()
        run.communicate(timeout=60)
    assert run.returncode == 128 + signal.SIGTERM


def test_a_killed_run_leaves_no_temporary_files_for_ever(taxel, tmp_path):
    """One that is killed while it draws, and the same command once more."""
    code = (
        "import os, signal, sys, matplotlib.figure as f\n"
        "f.Figure.savefig = lambda *a, **k: os.kill(os.getpid(), signal.SIGKILL)\n"
        "from taxel_cli import main; main()"
    )
    words = ["sweep", "plate.xml", "--vary", "z=0.6,0.7", "--points", "16", "-o", "out"]
    killed = subprocess.run([sys.executable, "-c", code, *words], cwd=tmp_path, capture_output=True)
    assert killed.returncode == -signal.SIGKILL and list(tmp_path.glob("out/.taxel-*.png"))
    assert taxel(*words).returncode == 0 and not list(tmp_path.glob("out/.taxel-*"))


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    """A small scene with a pad, and a study of it."""
    from mitsuba_taxel import Pad, PadSensor, PhotoReflector, sweep, write_xml

    folder = tmp_path_factory.mktemp("pressed")
    sensor = PadSensor(Pad("cylindrical", 1, 1), photo_reflector=PhotoReflector(rows=1, columns=1), force=(0, 0, -0.5))
    write_xml(sensor.scene(), folder / "pad.xml")
    sweep(folder / "pad.xml", {"fz": "0,-0.25,-0.5"}, points=16, output=folder / "study")
    return folder


@pytest.fixture
def full_disk(tmp_path):
    """A folder on a file system of its own with 4 kB left."""
    place = tmp_path / "full"
    place.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", place], capture_output=True).returncode:
        pytest.skip("file systems can be mounted by root alone")
    with (place / "fill").open("wb", buffering=0) as file:
        try:
            while file.write(b"\0" * 4096):
                pass
        except OSError as error:
            assert error.errno == errno.ENOSPC
    os.truncate(place / "fill", os.path.getsize(place / "fill") - 4096)
    yield place
    subprocess.run(["umount", place], check=True)


@pytest.mark.parametrize(
    "words",
    [
        ("report", "{there}/study", "-o", "full/report.html"),
        ("characterise", "{there}/study", "-o", "full/figures"),
        ("deform", "{there}/pad.xml", "--vtu", "-o", "full/pads"),
    ],
    ids=lambda words: words[0],
)
def test_a_full_disk_is_one_line(taxel, full_disk, pressed, words):
    done = taxel(*(word.format(there=pressed) for word in words))
    assert done.returncode == 1 and done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("taxel: full/") and line.endswith("cannot be written: No space left on device.")
    assert not [file for file in full_disk.rglob("*") if file.name.startswith(".")]


ODD = [(b"b\xffd", {}), ("straße".encode(), {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"})]


@pytest.mark.parametrize(("name", "environment"), ODD, ids=["not UTF-8", "ASCII locale"])
@pytest.mark.parametrize(
    "words",
    [
        ("render", "NAME.xml"),
        ("deform", "pad.xml", "-o", "NAME"),
    ],
    ids=lambda words: words[0],
)
def test_names_that_cannot_be_told_are_refused(program, tmp_path, name, environment, words):
    scene = os.path.join(os.fsencode(tmp_path), name + b".xml")
    with open(scene, "wb") as file:
        file.write(find_scene("plate.xml").read_bytes())
    command = [os.fsencode(program), *(word.encode().replace(b"NAME", name) for word in words)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, env={**os.environ, **environment})
    assert done.returncode == 2 and done.stdout == b""
    (line,) = done.stderr.splitlines()
    assert b"a name in UTF-8, in a locale that has its letters, is needed" in line


def test_a_folder_above_whose_name_is_no_text(program, tmp_path):
    folder = os.path.join(os.fsencode(tmp_path), b"b\xffd")
    os.mkdir(folder)
    with open(os.path.join(folder, b"own.xml"), "wb") as file:
        file.write(find_scene("plate.xml").read_bytes())
    words = ["sweep", "own.xml", "--vary", "z=1", "--points", "1", "-o", "out"]
    done = subprocess.run([program, *words], cwd=folder, capture_output=True)
    assert done.returncode == 2 and done.stderr.count(b"\n") == 1 and len(done.stderr) < 400


def test_a_scheduler_that_dies_is_one_line(program, tmp_path):
    pytest.importorskip("distributed")
    code = (
        "from distributed import LocalCluster; import sys, time\n"
        "if __name__ == '__main__':\n"
        "    c = LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address='127.0.0.1:0',\n"
        "                     host='127.0.0.1', protocol='tcp', silence_logs=50)\n"
        "    print(c.scheduler_address, flush=True); time.sleep(600)\n"
    )
    how = {"cwd": tmp_path, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
    with started([sys.executable, "-c", code], **how) as cluster:
        address = cluster.stdout.readline().strip()
        with begun([program, *LONG, "--scheduler", address], tmp_path) as run:
            cluster.kill()
            cluster.communicate()
            out, err = run.communicate(timeout=60)
    said = f"taxel: the Dask scheduler at {address} is gone: finished jobs are kept, and the same call resumes.\n"
    assert (run.returncode, out, err) == (1, "", said)


def test_all_questions_about_a_scene_load_it_once(monkeypatch, capsys):
    from click.testing import CliRunner
    from taxel_cli.readings.render import command

    loads = []
    load = Scene.load
    monkeypatch.setattr(Scene, "load", lambda self: loads.append(self) or load(self))
    words = ["plate.xml", "--points", "64", "--crosstalk", "--audit", "--explain", "--json"]
    done = CliRunner().invoke(command, words)
    answer = json.loads(done.stdout)
    assert {"readings", "crosstalk", "audit", "left_out"} <= set(answer) and len(loads) == 1


def test_a_time_budget_alone_says_that_it_was_used_up(taxel):
    done = taxel("render", "plate.xml", "--time-budget", "1ms", "--json")
    assert "time budget used up after 256 points" in json.loads(done.stdout)["notes"]


def test_a_study_file_may_begin_with_a_byte_order_mark(taxel, tmp_path):
    text = 'scene = "plate.xml"\npoints = 16\n[vary]\nz = "0.5"\n'
    (tmp_path / "study.toml").write_bytes(b"\xef\xbb\xbf" + text.encode())
    done = taxel("sweep", "study.toml", "-o", "out")
    assert done.returncode == 0 and done.stderr == ""


@pytest.mark.skipif(os.geteuid() != 0, reason="takes root to become nobody")
@pytest.mark.parametrize("ask", [lambda: find_scene("shut/plate.xml"), lambda: open_study("shut")])
def test_what_may_not_be_read_is_not_said_to_be_missing(tmp_path, monkeypatch, ask):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shut").mkdir(mode=0o700)
    os.seteuid(65534)
    try:
        with pytest.raises(InputError, match="shut.* cannot be read: Permission denied"):
            ask()
    finally:
        os.seteuid(0)


def test_a_folder_is_no_scene(taxel, tmp_path):
    (tmp_path / "folder").mkdir()
    done = taxel("render", "folder")
    assert done.returncode == 2 and done.stderr == "taxel: scene 'folder' cannot be read: it is a folder.\n"


@pytest.mark.parametrize("words", [("plugins",), ("--help",), ("render", "plate.xml", "--points", "1")])
def test_a_full_standard_output_is_one_line(program, tmp_path, words):
    with open("/dev/full", "w") as full:
        done = subprocess.run([program, *words], cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.stderr == "taxel: standard output cannot be written: No space left on device\n"
    assert done.returncode == 1


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_none_of_its_files(program, tmp_path, closed):
    line = f"exec {program} render plate.xml --points 1 -o map.exr {closed}"
    done = subprocess.run(["bash", "-c", line], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "map.exr").read_bytes()[:4] == b"\x76\x2f\x31\x01"
    assert ("Seconds" in done.stdout) is (closed == "2>&-")


def test_a_working_directory_that_is_gone_is_one_line(program, tmp_path):
    line = f"mkdir gone && cd gone && rmdir ../gone && exec {program} render plate.xml --points 1"
    done = subprocess.run(["bash", "-c", line], cwd=tmp_path, capture_output=True, text=True)
    said = "taxel: the working directory cannot be read: No such file or directory.\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", said)


def test_control_characters_of_names_do_not_reach_the_terminal(taxel, tmp_path):
    name, shown = "a\x1b]0;title\x07\x9b31m", r"a\x1b]0;title\x07\x9b31m"
    scene = tmp_path / f"{name}.xml"
    scene.write_text("<scene")
    (tmp_path / name).mkdir()
    unknown = ("render", "plate.xml", "-D", f"{name}=1")
    for words in (("check", scene.name), ("render", scene.name), ("status", name), unknown):
        done = taxel(*words)
        assert shown in done.stdout + done.stderr
        assert not {"\x1b", "\x07", "\x9b"} & set(done.stdout + done.stderr)


@pytest.mark.parametrize("seconds", [0.15, 0.3, 0.5, 0.8])
def test_an_interrupt_while_it_is_imported_leaves_no_traceback(program, tmp_path, seconds):
    with started([program, *LONG], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        time.sleep(seconds)
        out, err = interrupted(run)
    before_our_first_line = err.endswith("    from taxel_cli import main\nKeyboardInterrupt\n")  # on a loaded machine
    assert err.strip() in ("", "taxel: interrupted") or before_our_first_line, err
    assert run.returncode in (130, -signal.SIGINT) or before_our_first_line


@pytest.mark.parametrize(("ended", "expected"), [([], click.Abort), ([signal.SIGTERM], taxel_cli._Ended)])
def test_an_interrupt_while_a_message_is_composed_ends_the_program_as_any_other(ended, expected, monkeypatch):
    """Messages of ends of load paths may take a solution."""

    class Composed(RuntimeError):
        def __str__(self):
            raise KeyboardInterrupt

    def fail():
        raise Composed

    command = click.Command("render", callback=fail)
    monkeypatch.setattr(taxel_cli._Commands, "get_command", lambda self, ctx, name: command)
    with pytest.raises(expected):
        taxel_cli.taxel.main(["render"], "taxel", standalone_mode=False, obj=SimpleNamespace(debug=False, ended=ended))
