"""`taxel characterise`: a study and a measurement through one command."""

from __future__ import annotations

import json
import os
import sys

import numpy as np
import pytest
import taxel_cli
import xarray as xr
from plate_scenes import PLATE_FILE

import mitsuba_taxel
from mitsuba_taxel.characterise.characteristics import SLOPES

PLOTS = [f"{name}.{form}" for name in ("nonlinearity", "sensitivity") for form in ("png", "svg")]
FILES = ["characteristics.csv", "characteristics.tex", *PLOTS]


@pytest.fixture
def characterise(monkeypatch, capfd):
    """Run the command as the program does: words -> exit code, stdout, stderr."""
    monkeypatch.setattr(taxel_cli, "COMMANDS", ("characterise",))
    monkeypatch.setattr(taxel_cli, "_keep_stdout_for_results", lambda: None)
    monkeypatch.setenv("PYTHONSAFEPATH", "1")  # the program sets it

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["taxel", "characterise", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            taxel_cli.main()
        return end.value.code or 0, *capfd.readouterr()

    return run


@pytest.fixture
def bench(tmp_path):
    """A file of two cycles 0 -> 10 -> 0 N: 0.02 V/N, on a loop that is 4 % of 0.2 V wide."""
    share = np.concatenate([np.linspace(0, 1, 401), np.linspace(1, 0, 401)] * 2)
    falls = np.tile(np.repeat([0.0, 1], 401), 2)
    rng = np.random.default_rng(1)
    volts = 1 + 0.2 * share + 0.032 * falls * share * (1 - share) + 2e-4 * rng.normal(size=share.size)
    rows = [f"{0.1 * n:.1f},{10 * s:.4f},{v:.5f}" for n, (s, v) in enumerate(zip(share, volts, strict=True))]
    (tmp_path / "bench").mkdir()
    file = tmp_path / "bench" / "pad.csv"
    file.write_text("\n".join(["# a bench", "time_s,fz_N,v11_V", *rows]))
    return file


def test_a_measurement(characterise, bench):
    code, out, err = characterise(bench)
    assert code == 0 and err == ""
    assert sorted(os.listdir(bench.parent)) == sorted([*FILES, "pad.csv"])
    answer, table = out.split("\n\n")[:2]
    assert answer.startswith("Mean slopes over fz: ") and answer.endswith(" mV/N or less.")
    title, _, head, first, second = table.splitlines()
    assert title == "Sensitivities, fz:" and head.split()[:3] == ["taxel", "loading", "[mV/N]"]
    assert first.split()[:2] == ["11", "1"]
    assert "4 runs of 40 points or more." in out and "Error: 1 sigma of the recording's noise." in out
    assert out.splitlines()[-1].startswith("Results: ")


def test_a_measurement_in_json(characterise, bench, tmp_path):
    code, out, err = characterise(bench, "-o", tmp_path / "new" / "place", "--json")
    answer = json.loads(out)
    assert code == 0 and err == "" and list(answer) == ["characteristics", "symmetric_pairs", "notes", "files"]
    assert sorted(os.listdir(tmp_path / "new" / "place")) == FILES and os.listdir(bench.parent) == ["pad.csv"]
    found = {(row["figure"], row["loading"]): row for row in answer["characteristics"]}
    for figure, truth in (("mean_slope", 0.02), ("hysteresis", 4)):
        for loading in (1, 2):
            row = found[figure, loading]
            assert abs(row["value"] - truth) < 5 * row["error"] < 0.2 * truth
    assert abs(found["repeatability", 2]["value"]) < 5 * found["repeatability", 2]["error"] < 1
    assert found["mean_slope", 1]["at_N"] is None and found["mean_slope", 1]["unit"] == "V/N"


@pytest.mark.parametrize(
    "name, said",
    [
        ("none", "is not allowed: the output folder of a study, with study.toml, is needed."),
        ("none.csv", "cannot be read (No such file or directory): a CSV file is needed."),
    ],
)
def test_what_is_not_there(characterise, tmp_path, name, said):
    code, out, err = characterise(tmp_path / name)
    assert code == 2 and out == "" and err.count("\n") == 1 and err.endswith(f"{said}\n")


def test_a_study(characterise, tmp_path):
    (tmp_path / "scene.xml").write_text(PLATE_FILE)
    mitsuba_taxel.sweep(tmp_path / "scene.xml", {"fz": "0.6:1:0.1"}, points=64, output=tmp_path / "study")
    before = os.listdir(tmp_path / "study")
    code, out, err = characterise(tmp_path / "study", "--json")
    assert code == 0 and err == ""
    assert sorted(set(os.listdir(tmp_path / "study")) - set(before)) == FILES
    rows = json.loads(out)["characteristics"]
    assert {row["figure"] for row in rows} == {*SLOPES, "nonlinearity"}
    assert [row["value"] for row in rows if row["figure"] == "zero_slope"] == [None]


def tangential(taxels: int) -> xr.Dataset:
    power = np.linspace(0, -8, 5)[:, None, None] * np.linspace(-1, 1, taxels) * 1e-4
    power = power + 1e-6 * np.random.default_rng(1).normal(size=(5, 8, taxels))
    coords = {"fx": np.linspace(0, -8, 5), "taxel": range(1, taxels + 1)}
    return xr.Dataset({"replicate_power": (["fx", "replicate", "taxel"], power)}, coords=coords)


MAPS = ["symmetric_pairs.csv", "tangential_map.png", "tangential_map.svg"]


@pytest.mark.parametrize("taxels, maps", [(9, MAPS), (12, [])])
def test_a_tangential_load(characterise, tmp_path, monkeypatch, taxels, maps):
    """A map and its pairs; where taxels are no grid, the rest comes without them and says so."""
    monkeypatch.setattr(mitsuba_taxel, "open_study", lambda folder: tangential(taxels), raising=False)
    code, out, err = characterise(tmp_path)
    assert code == 0 and err == "" and sorted(os.listdir(tmp_path)) == sorted([*FILES, *maps])
    assert ("Symmetric pairs" in out) == bool(maps) and ("12 taxels do not form a square" in out) != bool(maps)


def test_scenes_notes_and_missing_readings(characterise, tmp_path, monkeypatch):
    studies = {name: tangential(4).assign_attrs(notes="mechanics error unknown") for name in ("flat", "round")}
    studies["round"].replicate_power[2:4] = np.nan
    monkeypatch.setattr(mitsuba_taxel, "open_study", lambda folder: xr.DataTree.from_dict(studies), raising=False)
    code, out, err = characterise(tmp_path)
    assert code == 0 and err == "" and out.splitlines()[4].split()[:2] == ["scene", "taxel"]
    assert out.count("mechanics error unknown") == 1 and "Jobs without a reading, left out: 2." in out


def test_what_cannot_be_characterised_is_one_line(characterise, tmp_path, bench, monkeypatch):
    (tmp_path / "words.csv").write_text("time_s,force_N,v1_V\n" + "1,2,three\n" * 20)
    (tmp_path / "empty").mkdir()
    requests = {
        (tmp_path / "nowhere",): "nowhere",
        (tmp_path / "empty",): "empty",
        (tmp_path / "words.csv",): "line 2, column v1_V: 'three'",
        (bench, "-o", bench): "pad.csv",
        (): "DIR|FILE.csv",
    }
    for words, culprit in requests.items():
        code, out, err = characterise(*words)
        (line,) = err.splitlines()
        assert code == 2 and out == "" and line.startswith("taxel: ") and culprit in line
    still = tangential(9).isel(fx=[0])
    monkeypatch.setattr(mitsuba_taxel, "open_study", lambda folder: still, raising=False)
    code, out, err = characterise(tmp_path)
    assert code == 2 and out == "" and "varies fx, fy or fz" in err
