"""What the README shows works as it stands there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.+?)\n```$", README, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("name", ["main", "tests"])
def test_ci_finds_its_commands(name):
    assert len(re.findall(rf"^<!-- command: {name} -->\n```sh\n.+\n```$", README, re.MULTILINE)) == 1


def test_python_and_scene_agree(tmp_path, monkeypatch):
    from mitsuba_taxel import measure

    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(blocks("python")[0], names)
    readings = names["readings"]
    assert readings.power.shape == (4,) and np.all(readings.total_error <= 0.01 * readings.power)
    assert names["study"].sizes["fz"] == 3

    few = {"points": 256, "seed": 1, "mechanics_error": False}
    in_python, written = measure(names["scene"], **few), measure(tmp_path / "hemispheric.xml", **few)
    assert np.array_equal(written.replicates, in_python.replicates)

    (tmp_path / "scene.xml").write_text(blocks("xml")[0])
    np.testing.assert_allclose(measure(tmp_path / "scene.xml", **few).power, in_python.power, rtol=1e-5)


def test_mitsuba_loads_the_scene_as_the_readme_says(tmp_path):
    """In a program of its own: the variant is chosen there."""
    (tmp_path / "scene.xml").write_text(blocks("xml")[0])
    choice = re.search(r'`(mi\.set_variant\("\w+"\))`', README)
    assert "`import mitsuba_taxel`" in README and choice
    program = f"import mitsuba_taxel\nimport mitsuba as mi\n{choice[1]}\n"
    program += "print(len(mi.load_file('scene.xml', parallel=False).emitters()))"
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout.split()) == (0, ["1"]), done.stderr


def test_it_is_short():
    assert len(README.splitlines()) <= 130


def test_links_lead_somewhere():
    for target in re.findall(r"\]\((?!https?://)([^)]+)\)", README):
        assert (Path(__file__).parents[1] / target).is_file(), target
