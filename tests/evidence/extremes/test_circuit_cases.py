"""Rows of circuits: right ones and wrong ones, and a reference that is known otherwise."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.electronics import Circuit
from mitsuba_taxel.evidence.extremes import circuit_cases as module
from mitsuba_taxel.evidence.extremes.circuit_cases import CircuitCase, circuit_cases, emitter_voltage
from mitsuba_taxel.evidence.extremes.circuit_row import CircuitRow
from mitsuba_taxel.evidence.extremes.stability import check
from mitsuba_taxel.evidence.extremes.tables import write_csv, write_markdown
from mitsuba_taxel.evidence.rows.row import cells, headings

PLAIN = Circuit(supply=3.3, load_resistance=1e4, transfer=8e-3)


def test_every_row_is_right_and_has_a_name_of_its_own():
    cases = circuit_cases()
    assert len({case.name for case in cases}) == len(cases) > 20
    for case in cases:
        row = pickle.loads(pickle.dumps(case)).measured()
        assert (row.verdict, row.wrong) == ("right", ""), row


def test_the_reference_where_the_equation_can_be_solved():
    """Far from saturation the light's current flows; half of it where the rest of the supply is the saturation voltage;
    without load, the emitter is at the supply."""
    assert float(emitter_voltage(PLAIN, 1e-6)) == pytest.approx(8e-5, rel=1e-12)
    half = (3.3 - 0.1) / 1e4 / 8e-3 * 2
    assert float(emitter_voltage(PLAIN, half)) == pytest.approx(3.2, abs=1e-3)
    assert float(emitter_voltage(replace(PLAIN, load_resistance=math.inf), 1e-9)) == pytest.approx(3.3, rel=1e-15)
    assert emitter_voltage(replace(PLAIN, load_resistance=0.0), 1e-3) == 0 == emitter_voltage(PLAIN, 0.0)


@pytest.mark.parametrize(
    ("change", "wrong"),
    [
        ({"voltage": np.array(0.79)}, "another voltage"),
        ({"voltage": np.array(math.nan)}, "another voltage"),
        ({"counts": np.array(993)}, "other counts"),
    ],
)
def test_wrong_responses_are_told(monkeypatch, change, wrong):
    really = module.respond
    case = CircuitCase("a", 1e-2)
    assert case.measured().wrong == ""
    monkeypatch.setattr(module, "respond", lambda *given: really(*given)._replace(**change))
    row = case.measured()
    assert row.wrong == wrong
    with pytest.raises(ComputationError, match="1 of 1 rows are wrong: a."):
        check([row])


@pytest.mark.parametrize("noise", [math.nan, 0.0])
def test_wrong_noise_is_told(monkeypatch, noise):
    monkeypatch.setattr(module, "total_noise", lambda *given: np.array(noise))
    assert CircuitCase("a", 1e-2).measured().wrong == "the noise is not a number"


def test_a_circuit_that_is_refused_is_wrong():
    row = CircuitCase("a", 1e-2, {"supply": -1.0}).measured()
    assert row.verdict.startswith("refused: supply = -1") and row.wrong == "it should not be refused"


def test_rows_as_files(tmp_path):
    row = CircuitRow("a", "right", voltage=0.8, reference=0.8, counts=992, noise=2.3e-4)
    assert cells(row)[2:6] == ["0.8", "0.8", "992", "2.30e-04"]
    write_markdown([row], tmp_path / "t.md", "taxel bench stability", "All cases are measured.")
    page = (tmp_path / "t.md").read_text()
    assert "## Circuits" in page and "## Readings" not in page
    assert f"| {' | '.join(headings(CircuitRow))} |" in page
    write_csv([row], tmp_path / "t.csv")
    assert "voltage" in (tmp_path / "t.csv").read_text().splitlines()[0].split(",")
