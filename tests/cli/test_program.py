"""The program as a whole: quick help, clean streams, exit codes."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
import warnings
from importlib.resources import files

import click
import pytest
import taxel_cli
import trimesh
from one_cell import one_cell
from started_process import started

PLATE = ("plate.xml", "-D", "scattering=lambertian", "-D", "hole=0")


def test_help_lists_the_commands(taxel):
    done = taxel("--help")
    assert done.returncode == 0 and "sweep" in done.stdout


def test_help_imports_nothing_heavy():
    heavy = {"mitsuba", "mitsuba_taxel", "numpy", "scipy", "xarray", "matplotlib", "rich"}
    code = "import sys, taxel_cli; taxel_cli.taxel(['--help'], standalone_mode=False); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not heavy & set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("command", taxel_cli.COMMANDS)
def test_every_command_has_help(taxel, command):
    done = taxel(command, "--help")
    assert done.returncode == 0 and done.stdout.startswith(f"Usage: taxel {command}")


def test_without_a_command_help_is_shown(taxel_process):
    done = taxel_process()
    assert done.returncode == 2 and done.stdout == "" and "Usage: taxel" in done.stderr


JSON_KEYS = ["readings", "error_budget", "pads", "mesh_size_mm", "seconds", "parameters", "notes"]


def test_render_table(taxel_process):
    done = taxel_process("render", *PLATE, "--points", 256)
    assert done.returncode == 0 and done.stderr == ""
    answer, blank, heading, row, *rest = done.stdout.splitlines()
    assert answer.startswith("Power on the phototransistor: ") and blank == ""
    assert heading.split()[:3] == ["taxel", "power", "[W]"] and heading.endswith("photocurrent [A]")
    assert row.split()[0] == "1" and float(row.split()[-1]) == pytest.approx(0.746 * float(row.split()[1]), rel=1e-3)
    assert "32 randomisations of 256 points" in rest[0] and rest[-1].startswith("Seconds: ")


def test_render_json_is_one_object(taxel):
    done = taxel("render", *PLATE, "--points", 256, "--json")
    assert done.returncode == 0 and done.stderr == ""
    answer = json.loads(done.stdout)
    assert list(answer) == JSON_KEYS
    (reading,) = answer["readings"]
    errors = ["standard_error_W", "mechanics_error_W", "geometry_error_W", "total_error_W"]
    assert list(reading) == ["taxel", "power_W", *errors, "photocurrent_A"] and reading["taxel"] == 1
    assert 0 < reading["standard_error_W"] < reading["power_W"] < 1
    assert {"load", "optics"} <= set(answer["seconds"])
    assert answer["parameters"]["z"] == "0.7" and answer["parameters"]["hole"] == "0"


def test_target_error_in_percent_or_as_a_share(taxel):
    answers = [json.loads(taxel("render", *PLATE, "--target-error", x, "--json").stdout) for x in ("0.2%", "0.002")]
    assert answers[0]["readings"] == answers[1]["readings"]
    (reading,) = answers[0]["readings"]
    assert reading["standard_error_W"] < 0.002 * reading["power_W"]


def test_another_seed_gives_another_estimate(taxel):
    readings = [
        json.loads(taxel("render", *PLATE, "--points", 256, "--seed", seed, "--json").stdout)["readings"]
        for seed in (0, 0, 1)
    ]
    assert readings[0] == readings[1] != readings[2]


def test_audit_and_crosstalk_follow_the_readings(taxel):
    done = taxel("render", *PLATE, "--points", 256, "--audit", "--crosstalk")
    assert done.returncode == 0 and done.stderr == ""
    _, _, matrix, book = done.stdout.split("\n\n")
    assert matrix.splitlines()[1].split() == ["LED", "1"] and matrix.splitlines()[2].split()[2] == "+-"
    names = [line.rsplit(maxsplit=2)[0] for line in book.splitlines()[2:]]
    surfaces = ["photo_reflector body", "photo_reflector led", "rectangle"]
    assert names == [*surfaces, "detected", "escaped", "lost by single scattering", "unfinished", "total"]
    assert book.splitlines()[-1].split()[1] == "1.000000"


def test_audit_and_crosstalk_in_json(taxel):
    done = taxel("render", *PLATE, "--points", 256, "--audit", "--crosstalk", "--json")
    answer = json.loads(done.stdout)
    assert list(answer) == [*JSON_KEYS, "crosstalk", "audit"]
    assert answer["crosstalk"]["power_W"][0][0] == pytest.approx(answer["readings"][0]["power_W"], rel=0.01)
    audit = answer["audit"]
    assert sum(row["share"] for row in audit["shares"]) == pytest.approx(audit["total"]) == pytest.approx(1)
    assert all(list(row) == ["place", "share", "standard_error"] for row in audit["shares"])


def test_a_target_that_is_not_reached_does_not_look_like_success(taxel, tmp_path):
    """The readings are there all the same; exit code and a line on stderr say that they are not as good as asked."""
    asked = (*PLATE, "--target-error", "0.0001%", "--time-budget", "1ms")
    for words in (("render", *asked), ("render", *asked, "--json")):
        done = taxel(*words)
        assert done.returncode == 3 and done.stderr.strip().startswith("taxel: target error 1e-06 not reached")
        assert "power" in done.stdout
    done = taxel("sweep", *asked, "--vary", "z=0.5,1", "-o", "out")
    assert done.returncode == 3 and "target error 1e-06 not reached: 1 of 1 readings" in done.stderr
    assert "1 of 2 scenes have no reading yet: the same command computes them" in done.stderr
    assert done.stdout.count("not reached") == 1 and (tmp_path / "out" / "readings.csv").exists()
    reached = taxel("sweep", *PLATE, "--target-error", "5%", "--vary", "z=0.5,1", "-o", "reached")
    assert reached.returncode == 0 and "not reached" not in reached.stdout + reached.stderr


def test_time_budget_ends_a_run(taxel):
    done = taxel("render", *PLATE, "--points", 1 << 20, "--time-budget", "1ms")
    assert done.returncode == 0 and "time budget" in done.stdout


def test_rays_as_picture_and_polylines(taxel, tmp_path):
    done = taxel("rays", *PLATE, "--count", 20, "-o", "rays.svg", "--vtk", "rays.vtk", "--json")
    assert done.returncode == 0 and done.stderr == ""
    answer = json.loads(done.stdout)
    assert (answer["taxel"], answer["paths"], answer["reached"]) == (1, 20, 10)
    assert answer["files"] == ["rays.svg", "rays.vtk"] and sorted(os.listdir(tmp_path)) == answer["files"]
    assert "LINES 20 " in (tmp_path / "rays.vtk").read_text()


def test_map_has_channel_units_and_parameters(taxel, tmp_path):
    import OpenEXR

    done = taxel("render", *PLATE, "--points", 256, "--seed", 3, "-o", "map.exr", "--json")
    image = OpenEXR.File(str(tmp_path / "map.exr"))
    header, channels = image.header(), image.channels()
    assert list(channels) == ["irradiance"]
    assert header["units"] == "irradiance in W/mm2" and header["seed"] == "3" and header["points"] == "256"
    assert json.loads(header["parameters"])["scattering"] == "lambertian"
    power = json.loads(done.stdout)["readings"][0]["power_W"]
    assert channels["irradiance"].pixels.mean() * 0.52 * 0.3 == pytest.approx(power, rel=1e-5)
    assert os.listdir(tmp_path) == ["map.exr"]


def test_sweep_prints_one_object(taxel, tmp_path):
    done = taxel("sweep", *PLATE, "--vary", "z=0.5,1", "--points", 64, "-o", "out", "--json")
    assert done.returncode == 0 and done.stderr == ""
    answer = json.loads(done.stdout)
    assert list(answer) == ["output", "failures", "sensitivity", "error_budget", "seconds"]
    assert answer["sensitivity"] == answer["failures"] == []
    assert {"power.png", "power.svg", "readings.csv", "readings.nc"} <= set(os.listdir(tmp_path / "out"))
    (state,) = json.loads(taxel("status", "out", "--json").stdout)["scenes"]
    assert (state["done"], state["total"], state["running"]) == (2, 2, False)


def test_sweep_with_a_failed_scene_ends_with_exit_code_1(taxel, tmp_path):
    done = taxel("sweep", *PLATE, "--vary", "width=4,0", "--points", 64, "-o", "out")
    assert done.returncode == 1 and "1 readings" in done.stdout
    failed, advice = done.stderr.splitlines()
    assert failed.startswith("failed: width=0: ") and "--retry-failed" in advice


def test_pads_along_a_path_in_time(taxel, tmp_path):
    """Each step has those before it behind it, as a hold that creeps shows."""
    prony = '<string name="prony" value="0.2 1"/>'
    prony += '<float name="time" value="$time"/> <string name="history" value="$history"/>'
    scene = one_cell(fz=0, time=0, history="").replace('<vector name="force"', f'{prony} <vector name="force"')
    (tmp_path / "cell.xml").write_text(scene)
    (tmp_path / "cycle.csv").write_text("time,fz\n0,0\n0.1,-1\n9,-1\n60,0\n")
    done = taxel("deform", "cell.xml", "--steps", "cycle.csv", "-o", "pads", "--json")
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)["pads"]
    names = [f"pad_1_step_{step}.ply" for step in range(1, 5)]
    assert [row["file"].rpartition("/")[2] for row in rows] == names == sorted(os.listdir(tmp_path / "pads"))
    top = [trimesh.load(tmp_path / "pads" / name).bounds[1, 2] for name in names]
    assert top[2] < top[1] - 1e-2 and top[0] - top[3] < 0.01 * (top[0] - top[2])
    assert [row["time_s"] for row in rows[1:]] == [0.1, 9, 60]


def test_sweep_of_a_study_file(taxel, taxel_process, tmp_path):
    (tmp_path / "study.toml").write_text('scene = "plate.xml"\npoints = 64\n[vary]\nz = "0.5,1"\n')
    done = taxel_process("sweep", "study.toml", "-o", "out", "--workers", 1)
    assert done.returncode == 0 and done.stderr == "" and "2 readings" in done.stdout
    refused = taxel("sweep", "study.toml", "-o", "other", "--points", 128)
    assert refused.returncode == 2 and "points is not allowed with a study file" in refused.stderr


def test_interrupt_ends_workers_too(program, tmp_path):
    command = [
        program,
        "sweep",
        "plate.xml",
        "--vary",
        "z=0.1:90:0.1",
        "--points",
        "4096",
        "-o",
        "out",
        "--workers",
        "2",
    ]
    how = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    with started(command, cwd=tmp_path, **how) as run:
        while not list(tmp_path.glob("out/jobs/*.npz")):
            time.sleep(0.05)
        os.killpg(run.pid, signal.SIGINT)  # as a terminal does
        out, err = run.communicate(timeout=30)
    assert run.returncode == 130 and out == "" and err.strip() == "taxel: interrupted"


def test_interrupt_ends_cleanly(program, tmp_path):
    command = [program, "sweep", "plate.xml", "--vary", "z=0.1:90:0.1", "--points", "65536", "-o", "out"]
    with started(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        while not (tmp_path / "out").exists():
            time.sleep(0.05)
        time.sleep(0.5)
        run.send_signal(signal.SIGINT)
        out, err = run.communicate(timeout=30)
    assert run.returncode == 130 and out == "" and err.strip() == "taxel: interrupted"


def test_a_reader_that_stops_early_is_no_error(program, tmp_path):
    command = f"{program} plugins | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True)
    assert done.stderr == ""


@pytest.mark.parametrize(
    "error, said",
    [
        (KeyError("surprise"), "KeyError: 'surprise' (run with --debug for the traceback)"),
        (
            MemoryError(),
            "there is not enough memory for this command: fewer or smaller pads, points or workers need less.",
        ),
        (
            OSError(errno.ENOSPC, "No space left on device", "a.csv"),
            "a.csv cannot be read or written: No space left on device (run with --debug for the traceback)",
        ),
    ],
)
def test_what_nobody_foresaw_is_one_line_and_exit_code_1(monkeypatch, capfd, error, said):
    @click.command()
    def command():
        raise error

    monkeypatch.setattr(taxel_cli._Commands, "get_command", lambda *_: command)
    monkeypatch.setattr(sys, "argv", ["taxel", "render"])
    monkeypatch.setattr(taxel_cli, "_keep_stdout_for_results", lambda: None)
    monkeypatch.setenv("PYTHONSAFEPATH", "1")  # the program sets it
    with pytest.raises(SystemExit) as end:
        taxel_cli.main()
    assert end.value.code == 1
    assert capfd.readouterr().err == f"taxel: {said}\n"


def test_a_warning_is_one_line(monkeypatch, capfd):
    @click.command()
    def command():
        warnings.warn("solutions are not kept.", stacklevel=1)

    monkeypatch.setattr(taxel_cli._Commands, "get_command", lambda *_: command)
    monkeypatch.setattr(sys, "argv", ["taxel", "render"])
    monkeypatch.setattr(taxel_cli, "_keep_stdout_for_results", lambda: None)
    monkeypatch.setenv("PYTHONSAFEPATH", "1")  # the program sets it
    with warnings.catch_warnings(), pytest.raises(SystemExit) as end:
        warnings.simplefilter("always")
        taxel_cli.main()
    assert not end.value.code and capfd.readouterr().err == "taxel: solutions are not kept.\n"


@pytest.mark.parametrize("words", [["render"], ["rendr"], ["render", "--pionts", "3"], ["sweep", "plate.xml"]])
def test_what_is_missing_or_not_known_comes_with_where_to_look(taxel, words):
    done = taxel(*words)
    place = "taxel" if words == ["rendr"] else f"taxel {words[0]}"
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and done.stderr.endswith(f"(see {place} --help)\n")


def test_plugins_are_listed_and_described(taxel):
    from mitsuba_taxel.backend import plugin_files

    listed = taxel("plugins").stdout.splitlines()[1:]
    assert {line.split()[0] for line in listed} == set(plugin_files())
    done = taxel("plugins", "wall")
    assert done.returncode == 0 and "reflectance" in done.stdout and '<bsdf type="wall">' in done.stdout


def test_words_are_wrapped_and_all_shipped_scenes_are_named(taxel):
    shown = taxel("plugins", "deformable_pad").stdout
    assert max(map(len, shown.splitlines())) <= 100 and "Rigid motion" in shown
    scenes = [file.name for file in files("mitsuba_taxel.scenes").iterdir() if file.name.endswith(".xml")]
    assert len(scenes) > 2 and all(scene in taxel("--help").stdout for scene in scenes)


def test_the_cache_says_where_and_how_much_and_is_cleared(taxel, tmp_path, monkeypatch):
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "kept"))
    assert taxel("cache").stdout == f"folder: {tmp_path / 'kept'}\nkept: 0 entries, 0.0 MB of at most 10000 MB\n"
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / f"{64 * 'a'}.npz").write_bytes(bytes(2_000_000))
    (tmp_path / "kept" / "own.npz").touch()
    assert json.loads(taxel("cache", "--json").stdout)["bytes"] == 2_000_000
    assert taxel("cache", "--clear").stdout.startswith("removed: 1 entries, 2.0 MB\n")
    assert [file.name for file in (tmp_path / "kept").iterdir()] == ["own.npz"]
