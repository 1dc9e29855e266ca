"""The page of stated and true errors: each of its tables can be renewed without the others."""

from __future__ import annotations

import math

import numpy as np
import pytest
from click.testing import CliRunner
from taxel_cli.evidence.bench import command

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.evidence.coverage import coverage as table
from mitsuba_taxel.evidence.coverage.coverage import parts_with_cases
from mitsuba_taxel.evidence.coverage.coverage_row import CoverageRow
from mitsuba_taxel.evidence.intervals import intervals, probabilities
from mitsuba_taxel.evidence.intervals.intervals import IntervalCase
from mitsuba_taxel.evidence.intervals.probabilities import ProbabilityCase
from mitsuba_taxel.evidence.rows.row_files import matching


@pytest.fixture
def synthetic(monkeypatch):
    """Quick cases in place of the real ones: two figures, two kinds of probabilities, and rows of readings."""
    size = {"error": 0.0}
    counted = [IntervalCase(f"record: {name}", lambda seed: {"mean": size["error"]}, 4) for name in ("one", "two")]
    outcome = {"first": (np.array([0.9]), np.array([True]))}
    compared = [ProbabilityCase(f"compare: {name}", lambda seed: outcome, 4) for name in ("one", "two")]

    for module in (intervals, table):
        monkeypatch.setattr(module, "interval_cases", lambda only=None: matching(counted, only))
    for module in (probabilities, table):
        monkeypatch.setattr(module, "chosen_cases", lambda only=None: matching(compared, only))
    row = CoverageRow("", "", 9, 2e-3, 3e-3, 1e-3, 0, 0, 4, 3)
    monkeypatch.setattr(
        table, "measure_isolated", lambda case, seconds, memory: CoverageRow(**{**row.__dict__, "case": case.name})
    )
    return size


def run(folder, *arguments):
    files = ("--csv", str(folder / "a.csv"), "--markdown", str(folder / "a.md"))
    done = CliRunner().invoke(command, ["coverage", *arguments, *files])
    assert done.exit_code == 0, done.output
    lines = (folder / "a.md").read_text().splitlines()
    return {line.strip("| ").split(" | ")[0]: line for line in lines if line.startswith("| ")}


def test_one_table_is_renewed_without_the_others(synthetic, tmp_path):
    """Sections of the others were left out of the page."""
    run(tmp_path, "--only", "2 x 2")
    before = run(tmp_path, "--part", "figures")
    before = run(tmp_path, "--part", "probabilities")
    assert sum("2 x 2" in name for name in before) >= 4 and {"record: one", "compare: two", "all kinds"} <= set(before)
    synthetic["error"] = 3.0
    after = run(tmp_path, "--only", "record: one")
    assert {name for name in before if before[name] != after[name]} == {"record: one"} and list(before) == list(after)
    assert "| 100.0% |" in before["record: one"] and "| 0.0% |" in after["record: one"]
    again = run(tmp_path, "--only", "2 x 2", "--part", "readings")
    assert again == after


def test_a_pattern_chooses_cases_of_all_tables(synthetic):
    assert parts_with_cases("*") == parts_with_cases(None) == ["readings", "figures", "probabilities"]
    assert parts_with_cases("2 x 2") == ["readings"] and parts_with_cases("one", "figures") == ["figures"]
    with pytest.raises(InputError, match="only = 'sphericle' is not allowed: a part of the name of a case"):
        parts_with_cases("sphericle")
    with pytest.raises(InputError, match="only = '2 x 2' is not allowed"):
        parts_with_cases("2 x 2", "figures")


def test_files_hold_all_digits_and_cases_that_are_no_more_leave_them(synthetic, tmp_path, monkeypatch):
    synthetic["error"] = 1 / 3
    run(tmp_path, "--part", "figures")
    (row, _) = table.CoveragePage(tmp_path / "a.csv", None)._figures
    assert row.ratio == pytest.approx(1 / 3, rel=1e-15) and not math.isnan(row.seconds)
    monkeypatch.setattr(intervals, "interval_cases", lambda only=None: matching(table.interval_cases(), "two"))
    assert "record: one" not in run(tmp_path, "--only", "record: two")
