"""The table of readings with and without random numbers: its configurations, a slice of it, and its page."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from taxel_cli.evidence.bench import command

from mitsuba_taxel.evidence.coverage import light, light_cases
from mitsuba_taxel.evidence.coverage.light_row import LightRow
from mitsuba_taxel.evidence.rows.row_files import read_rows
from mitsuba_taxel.pads import CELL_SHAPES
from mitsuba_taxel.pads.cells.cell_shape import CellShape

SLICE = (9, 18, 21, 53)
"""Numbers of configurations with a narrow table, a cone, a power and a wide table."""


def test_configurations_are_of_every_kind_and_the_same_for_a_seed():
    cases = light_cases.light_cases()
    assert cases == light_cases.light_cases() != light_cases.light_cases(1)
    paper, others = cases[: light_cases.CASES], cases[light_cases.CASES :]
    assert len(cases) == len({case.name for case in cases}) and len(paper) == 120
    assert sum(case.with_slopes for case in paper) == 12
    leds = [case.source["package"]["led"] for case in cases]
    cones = [led["cone_angle"] for led in leds if "cone_angle" in led]
    assert min(cones) < 0.1 and max(cones) > 60
    exponents = [led["exponent"] for led in leds if "exponent" in led]
    assert min(exponents) < 1 and max(exponents) > 1e5
    assert {case.source["pad"]["cell"] for case in paper} == set(CELL_SHAPES)
    assert {case.source["pad"]["cell"] for case in others} == set(CellShape.kinds()) - set(CELL_SHAPES)
    assert any("force" in case.source["pad"] for case in cases) and any(case.with_slopes for case in others)
    assert {name for case in cases for name in case.tables} == {"led", "sensor"}


def test_configurations_that_were_measured_stay():
    rows = read_rows(Path(__file__).parents[3] / "docs" / "light.csv", LightRow)
    assert len(rows) >= 120 and rows.keys() <= {case.name for case in light_cases.light_cases()}


@pytest.mark.parametrize("number", SLICE)
def test_readings_without_random_numbers_are_those_of_random_paths(llvm_mono, monkeypatch, number):
    """Within 3 combined errors: one false alarm in 90 runs of these four."""
    monkeypatch.setattr(light_cases, "TRACE_SECONDS", 0.0)
    row = light_cases.light_cases()[number - 1].measured()
    assert not row.remark and row.deviates < 3, row


def made_up(case, **changed):
    return replace(
        LightRow(case.name, "no", 1e-3, 1e-4, 2e-4, 1e-5, seconds=1.0, tight_seconds=2.0, megabytes=400.0), **changed
    )


def test_the_page_counts_what_agrees(monkeypatch, tmp_path):
    changes = iter(
        [{}, {"off": 1e-3}, {"random": "yes", "off": 5e-4, "tight_seconds": 99.0}, {"remark": "no", "off": math.nan}]
    )
    monkeypatch.setattr(light, "measure_isolated", lambda case: made_up(case, **next(changes)))
    page, rows = tmp_path / "page.md", tmp_path / "rows.csv"
    asked = ["light", "--only", "00[1-4] ", "--csv", str(rows), "--markdown", str(page)]
    result = CliRunner().invoke(command, asked)
    assert result.exit_code == 0, result.output
    again = CliRunner().invoke(command, asked)  # nothing is measured, as there are no changes left
    assert again.exit_code == 0 and again.stdout == result.stdout
    for text in (result.output, page.read_text()):
        assert "2 of 3 readings agree within 3 combined errors, 1 within 2; 2 need no random paths" in text
        assert "1.1 times the deviation" in text and "1 readings take more than" in text
        assert "1 configurations could not be read" in text
    assert re.search(r"\| 20\d\d-\d\d-\d\d \d\d:\d\d \|", page.read_text())


def test_a_pattern_that_matches_nothing_is_refused():
    assert CliRunner().invoke(command, ["light", "--only", "torus"]).exit_code != 0
