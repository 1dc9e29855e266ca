"""`taxel render --derivatives`: a table, JSON, and one line for what has none."""

from __future__ import annotations

import json

import pytest
from one_cell import one_cell

PAD = one_cell(cell="cylindrical", mesh_size=1.7, scattering="$roof", fz=-0.5, roof="lambertian")


@pytest.fixture(autouse=True)
def scene(tmp_path):
    (tmp_path / "pad.xml").write_text(PAD)


def test_json_and_table_say_the_same(taxel):
    words = "render", "pad.xml", "--points", 16, "--derivatives", "fz, spacing"
    rows = json.loads(taxel(*words, "--json").stdout)["derivatives"]
    assert [(row["taxel"], row["parameter"], row["unit"]) for row in rows] == [(1, "fz", "W/N"), (1, "spacing", "W/mm")]
    assert all(0 < row["standard_error"] < 0.1 * abs(row["value"]) for row in rows)
    table = taxel(*words).stdout
    assert "fz [W/N]" in table and all(f"{row['value']:.4e} +- {row['standard_error']:.0e}" in table for row in rows)


def test_both_name_the_method(taxel):
    for roof, method in ("lambertian", "without random numbers"), ("mirror", "differences of random paths"):
        words = "render", "pad.xml", "--points", 16, "--derivatives", "spacing", "-D", f"roof={roof}", "-D", "fz=0"
        (row,) = json.loads(taxel(*words, "--json").stdout)["derivatives"]
        assert row["method"] == method and row["standard_error"] > 0
        assert f"Derivatives of the readings ({method}), +- standard error" in taxel(*words).stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--derivatives", "roof"), "roof = 'lambertian' has no derivative: it is not a number."),
        (("--derivatives", "hight"), "hight has no derivative: it is no number of the scene (parameters: fz, roof)"),
    ],
)
def test_what_has_no_derivative_is_refused_in_one_line(words, said, taxel):
    done = taxel("render", "pad.xml", "--points", 16, *words)
    assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1


def test_a_sweep_takes_its_slopes_from_derivatives(taxel, tmp_path):
    words = "sweep", "pad.xml", "--vary", "fz=0:-0.5:-0.5", "--points", 16, "--derivatives", "fz,spacing", "-o", "out"
    done = taxel(*words, "--json")
    (row,) = json.loads(done.stdout)["sensitivity"]
    from mitsuba_taxel import open_study

    study = open_study(tmp_path / "out").squeeze("taxel")
    at = study.derivative.sel(parameter="fz")
    assert row["zero_slope_W_per_N"] == pytest.approx(float(at.sel(fz=0)))
    assert abs(row["max_slope_W_per_N"]) >= float(abs(at).max()) and row["max_slope_error_W_per_N"] > 0
    said = taxel("characterise", "out", "-o", "figures").stdout
    assert "Slopes: from derivatives, without random numbers" in said
    assert study.derivative_unit.values.tolist() == ["W/N", "W/mm"]
