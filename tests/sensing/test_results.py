"""Results are listed once; numbers of deformed pads have errors that hold."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from mitsuba_taxel import Pad, PadSensor, Wall, open_study, sweep, write_template
from mitsuba_taxel.mechanics import NeoHookean, load_path
from mitsuba_taxel.sensing.reading import pad_results
from mitsuba_taxel.sensing.reading.pad_results import Estimate, PadResult
from mitsuba_taxel.sensing.reading.results import RESULTS


def test_names_are_distinct():
    names = [result.name for result in RESULTS]
    assert len(names) == len(set(names))


def numbers_of(file):
    """Columns of numbers of a table, to the last digit; pandas before version 3 rounds what it reads."""
    table = pd.read_csv(file, comment="#")
    exact = pd.read_csv(file, comment="#", dtype=str)
    return exact[list(table.select_dtypes("number"))].map(float)


@pytest.mark.parametrize("derivatives", [(), ("fz",)])
def test_tables_hold_every_listed_result_with_and_without_derivatives(tmp_path, derivatives):
    sensor = PadSensor(Pad(rows=1, columns=1), roof=Wall("lambertian", 0.8))
    study = sweep(sensor.scene(), vary={"fz": [0.0, -1.0]}, derivatives=derivatives, output=tmp_path / "study")
    table = numbers_of(tmp_path / "study" / "readings.csv")
    np.testing.assert_array_equal(table.largest_strain, study.largest_strain)
    np.testing.assert_array_equal(table.mechanics_error_W, study.mechanics_error.squeeze())
    assert table.largest_strain[0] == table.largest_strain_error[0] == 0 < table.largest_strain_error[1]
    by_force = study.derivative.sel(parameter="fz").squeeze()
    np.testing.assert_array_equal(table["derivative_fz_W/N"], by_force)
    assert "derivative_error_fz_W/N" in table and "largest_strain_derivative" in study
    stored = open_study(tmp_path / "study")
    np.testing.assert_array_equal(stored.largest_strain_error, study.largest_strain_error)


def test_studies_by_depth_hold_the_force_the_moment_and_the_place_of_an_indenter(tmp_path):
    """Columns of every file; all forces of a smooth ball pass through its centre."""
    write_template("touch", tmp_path / "touch.xml")
    size = {"rows": "1", "columns": "1", "indenter_radius": "1.5", "indenter_x": "0.3"}
    vary = {"indenter_depth": "0,0.15"}
    study = sweep(tmp_path / "touch.xml", vary, size, points=64, mesh_size=1.5, output=tmp_path / "study")
    assert study.reaction_fz[0] == study.reaction_fz_error[0] == study.reaction_my[0] == 0
    assert study.reaction_fz[1] < -10 * study.reaction_fz_error[1] < 0 and np.isnan(study.centre_of_pressure_x[0])
    assert study.centre_of_pressure_x[1] == pytest.approx(0.3, abs=0.02)
    assert study.reaction_fz.units == "N" and study.reaction_my.units == "N mm"
    table = numbers_of(tmp_path / "study" / "readings.csv")
    np.testing.assert_array_equal(table["reaction_fz_N"], study.reaction_fz)
    xr.testing.assert_identical(open_study(tmp_path / "study").reaction_my, study.reaction_my)
    centre = float(json.loads(study.attrs["parameters"])["height"]) + 1.5 - 0.15
    moment = centre * study.reaction_fx[1] - 0.3 * study.reaction_fz[1]
    assert study.reaction_my[1] == pytest.approx(float(moment), rel=0.01)


@pytest.mark.parametrize(("cell", "force"), [("parallelepiped", -1.5), ("cylindrical", -1.0), ("spherical", -0.5)])
def test_the_error_of_the_largest_strain_holds_against_finer_elements(cell, force):
    pad, loads = Pad(cell, rows=1, columns=1), [(0.0, 0.0, force)]
    coarse, fine = (load_path(pad, NeoHookean(), loads, mesh_size=size)[0] for size in (1.25, 0.4))
    (value, error), (true, _) = (
        pad_results.pad_results([state], with_errors=state is coarse)["largest_strain"] for state in (coarse, fine)
    )
    assert abs(value - true) < 2 * error < 0.5 * true


def test_the_largest_of_several_pads_counts_and_errors_may_be_unknown(monkeypatch):
    numbers = iter([1.0, 3.0, 2.0])
    entry = PadResult("height", "mm", "a number", lambda state, with_error: Estimate(next(numbers), float("nan")))
    monkeypatch.setattr(pad_results, "PAD_RESULTS", [entry])
    estimate = pad_results.pad_results([None, None, None])["height"]
    assert estimate.value == 3.0 and np.isnan(estimate.error)
