"""`taxel compare`: a ranking from a study on disk."""

from __future__ import annotations

import json

import pytest
from pages import assert_on_its_page
from plate_scenes import PLATE_FILE
from taxel_cli.results import compare

import mitsuba_taxel
from mitsuba_taxel.characterise.ranking import comparison


@pytest.mark.usefixtures("painted_figures")
def test_a_study_is_ranked(taxel, tmp_path):
    (tmp_path / "scene.xml").write_text(PLATE_FILE)
    vary = {"reflectance": "0.5,1", "fz": "0.6,0.8,1"}
    mitsuba_taxel.sweep(tmp_path / "scene.xml", vary, points=64, output=tmp_path / "out")
    done = taxel("compare", "out", "--by", "mean_slope", "-o", "ranking")
    assert done.returncode == 0 and done.stderr == ""
    assert {file.name for file in (tmp_path / "ranking").iterdir()} == {
        "comparison.csv", "comparison.png", "notes.txt", "printed.json",
    }  # fmt: skip
    assert_on_its_page(done, tmp_path / "ranking")
    answer, _, title, _, _, first, *_ = done.stdout.splitlines()
    assert answer.startswith("First: ") and answer.endswith("It is the best variant with a probability of 100.0%.")
    assert title == "By mean slope:" and first.split()[:2] == ["1", "1"] and "100.0%" in first
    rows = json.loads(taxel("compare", "out", "--at-most", "nonlinearity=100", "--json").stdout)["variants"]
    none = taxel("compare", "out", "--at-most", "mean_slope=1e-30")
    assert none.returncode == 1 and "In 100.0% of the draws no variant" in none.stdout and none.stderr.count("\n") == 1
    assert "no variant is within the limits (mean_slope at most 1e-30 W/N)" in none.stderr
    assert [row["rank"] for row in rows] == [1, 2] and {row["allowed"] for row in rows} == {1.0}


@pytest.mark.usefixtures("painted_figures")
def test_a_study_is_ranked_in_volts(taxel, tmp_path):
    """On a load that is too large the brighter variant saturates: the other one is more sensitive."""
    (tmp_path / "scene.xml").write_text(PLATE_FILE)
    vary = {"reflectance": "0.1,1", "fz": "0.6,0.8,1"}
    study = mitsuba_taxel.sweep(tmp_path / "scene.xml", vary, points=64, output=tmp_path / "out")
    dim, bright = study.power.sel(fz=0.6, taxel=1).values
    load = 3.3 / (0.5 * (dim + study.power.sel(fz=1, taxel=1).values[1]))
    table = f"supply = 3.3\nload_resistance = {load}\ntransfer = 1\nsaturation_voltage = 0\n"
    (tmp_path / "circuit.toml").write_text(table)
    watts = taxel("compare", "out", "--by", "mean_slope", "--json")
    done = taxel("compare", "out", "--by", "mean_slope", "--circuit", "circuit.toml", "-o", "ranking")
    assert done.returncode == 0 and "By mean slope, readings in V:" in done.stdout, done.stderr
    assert "Output of the circuit, fz:" in done.stdout
    assert {file.name for file in (tmp_path / "ranking").iterdir()} == {
        "comparison.csv", "comparison.png", "notes.txt", "printed.json", "volts.csv",
    }  # fmt: skip
    volts = json.loads(taxel("compare", "out", "--by", "mean_slope", "--circuit", "circuit.toml", "--json").stdout)
    first = {"watts": json.loads(watts.stdout)["variants"][0], "volts": volts["variants"][0]}
    assert {name: row["reflectance"] for name, row in first.items()} == {"watts": 1, "volts": 0.1}
    saturated = {row["reflectance"]: row["saturation_N"] for row in volts["volts"]}
    assert saturated[0.1] is None and saturated[1] == pytest.approx(0.6)
    assert volts["volts"][1]["noise_force_N"] is None  # infinite, which JSON does not know
    assert volts["units"]["mean_slope"] == "V/N"


@pytest.mark.parametrize("words", [("--by", "x"), ("--at-most", "x=1"), ("--at-most", "nonlinearity=-1"), ("nowhere",)])
def test_bad_input_is_one_line(taxel, words):
    done = taxel("compare", ".", *words)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and done.stdout == ""


def test_the_program_names_all_figures():
    assert compare.FIGURES == comparison.FIGURES
