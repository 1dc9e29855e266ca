"""`taxel check`: what it prints, and its exit codes."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner
from taxel_cli import tables
from taxel_cli.authoring.check import command

from mitsuba_taxel.check.schema import schema

SCENE = """<scene version="3.9.0">
<shape type="photo_reflector">
<float name="spacin" value="0.9"/>
<emitter type="annular_led"> <float name="power" value="0"/> </emitter> <sensor type="phototransistor"/>
</shape>
</scene>"""


@pytest.fixture
def taxel(taxel, tmp_path):
    (tmp_path / "scene.xml").write_text(SCENE)
    return taxel


def test_a_sound_scene(taxel):
    done = taxel("check", "pad.xml", "-D", "fz=-3")
    assert (done.returncode, done.stdout, done.stderr) == (0, "errors: 0, warnings: 0, notes: 0\n", "")


def test_an_error_is_exit_code_2(taxel):
    done = taxel("check", "scene.xml")
    counts, first, *_ = done.stdout.splitlines()
    assert (done.returncode, done.stderr, counts) == (2, "", "errors: 1, warnings: 1, notes: 0")
    assert first == (
        "scene.xml:3: error: spacin is no parameter of photo_reflector (did you mean spacing?)."
    )  # fmt: skip


@pytest.mark.parametrize("width", [60, None])
def test_lines_fit_the_terminal_and_stay_whole_in_a_pipe(monkeypatch, tmp_path, width):
    (tmp_path / "scene.xml").write_text(SCENE)
    monkeypatch.setattr(tables, "terminal_width", lambda: width)
    lines = CliRunner().invoke(command, [str(tmp_path / "scene.xml")]).stdout.splitlines()
    assert len(lines) == 3 if width is None else len(lines) > 3
    assert width is None or max(map(len, lines)) <= width
    assert "did you mean spacing?" in " ".join(lines)


def test_a_computation_that_stops_is_exit_code_1(taxel, tmp_path):
    """In the words of `taxel render`."""
    text = SCENE.replace("spacin", "spacing").replace('"power" value="0"', '"power" value="1"')
    soft = """<shape type="deformable_pad"> <integer name="rows" value="1"/> <integer name="columns" value="1"/>
        <float name="mesh_size" value="2.5"/> <vector name="force" value="0, 0, -99"/> </shape>"""
    (tmp_path / "scene.xml").write_text(text.replace("</scene>", f"{soft}</scene>"))
    checked, rendered = taxel("check", "scene.xml"), taxel("render", "scene.xml", "--points", "4")
    assert checked.returncode == rendered.returncode == 1
    message = rendered.stderr.strip().removeprefix("taxel: ")
    assert "the load path ends" in message and f"scene.xml: error: {message}\n" in checked.stdout


def test_for_machines_and_warnings_alone(taxel, tmp_path):
    (tmp_path / "scene.xml").write_text(SCENE.replace("spacin", "spacing"))
    done = taxel("check", "scene.xml", "--json")
    findings = json.loads(done.stdout)["findings"]
    assert done.returncode == 0
    assert ["warning", "scene.xml", 4] in [[f["severity"], f["file"], f["line"]] for f in findings]
    assert {key for finding in findings for key in finding} == {"severity", "message", "file", "line", "stopped"}


def test_the_schema_is_written(taxel, tmp_path):
    done = taxel("check", "--schema", "taxel.rng")
    assert (done.returncode, done.stdout) == (0, "Written: taxel.rng\n")
    assert (tmp_path / "taxel.rng").read_text() == schema()


@pytest.mark.parametrize(
    "words, culprit",
    [
        ((), "SCENE"),
        (("nowhere.xml",), "nowhere.xml"),
        (("pad.xml", "-D", "fzz=1"), "fzz"),
        (("study.toml",), "a study: a scene is needed"),
        (("--schema", "taxel.xsd"), ".rng"),
    ],
)
def test_a_request_that_cannot_be_met(taxel, tmp_path, words, culprit):
    (tmp_path / "study.toml").touch()
    done = taxel("check", *words)
    (line,) = done.stderr.splitlines()
    assert (done.returncode, done.stdout) == (2, "") and line.startswith("taxel: ") and culprit in line
