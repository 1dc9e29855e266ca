"""`taxel new`: a file is written once, under the name asked for or its own."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from taxel_cli.authoring.new import command

from mitsuba_taxel import InputError

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("scene",), "scene.xml"),
        (("study",), "study.toml"),
        (("steps",), "steps.csv"),
        (("circuit",), "circuit.toml"),
        (("scene", "mine.xml"), "mine.xml"),
    ],
)
def test_writes_a_file_once(tmp_path, monkeypatch, words, name):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(command, words)
    assert done.exit_code == 0 and done.stdout == f"Written: {name}\n"
    text = Path(name).read_text(encoding="utf-8")
    assert "taxel" in text and [file.name for file in Path().iterdir()] == [name]
    again = CliRunner().invoke(command, words)
    assert isinstance(again.exception, InputError) and name in str(again.exception)
    assert Path(name).read_text(encoding="utf-8") == text


def test_knows_no_other_kind():
    refused = CliRunner().invoke(command, ["pad"])
    assert refused.exit_code == 2 and "'pad'" in refused.stderr
