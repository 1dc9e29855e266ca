"""Results are listed once; numbers of deformed pads have errors that hold."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from mitsuba_taxel import Pad, PadSensor, Wall, open_study, sweep
from mitsuba_taxel.mechanics import NeoHookean, load_path
from mitsuba_taxel.sensing.reading import pad_results
from mitsuba_taxel.sensing.reading.pad_results import Estimate, PadResult
from mitsuba_taxel.sensing.reading.results import RESULTS


def test_names_are_distinct():
    names = [result.name for result in RESULTS]
    assert len(names) == len(set(names))


@pytest.mark.parametrize("derivatives", [(), ("fz",)])
def test_tables_hold_every_listed_result_with_and_without_derivatives(tmp_path, derivatives):
    sensor = PadSensor(Pad(rows=1, columns=1), roof=Wall("lambertian", 0.8))
    study = sweep(sensor.scene(), vary={"fz": [0.0, -1.0]}, derivatives=derivatives, output=tmp_path / "study")
    table = pd.read_csv(tmp_path / "study" / "readings.csv", comment="#")
    np.testing.assert_array_equal(table.largest_strain, study.largest_strain)
    np.testing.assert_array_equal(table.mechanics_error_W, study.mechanics_error.squeeze())
    assert table.largest_strain[0] == table.largest_strain_error[0] == 0 < table.largest_strain_error[1]
    by_force = study.derivative.sel(parameter="fz").squeeze()
    np.testing.assert_array_equal(table["derivative_fz_W/N"], by_force)
    assert "derivative_error_fz_W/N" in table and "largest_strain_derivative" in study
    stored = open_study(tmp_path / "study")
    np.testing.assert_array_equal(stored.largest_strain_error, study.largest_strain_error)


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
