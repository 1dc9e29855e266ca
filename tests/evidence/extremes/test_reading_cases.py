"""Rows of readings: right ones, wrong ones, refusals; and sums of many numbers."""

from __future__ import annotations

import math
import pickle
import re

import pytest

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.extremes.reading_cases import ComparedReading, ReadingCase, reading_cases, running_sum_error
from mitsuba_taxel.evidence.extremes.reading_row import ReadingRow
from mitsuba_taxel.evidence.extremes.stability import check
from mitsuba_taxel.evidence.extremes.tables import write_csv, write_markdown
from mitsuba_taxel.evidence.rows import isolated_process
from mitsuba_taxel.evidence.rows.row import cells, headings


def known(power, reference):
    return lambda: ComparedReading(power, 1e-3, reference, 0.0, "hand")


def refusing(error):
    def look():
        raise error

    return look


@pytest.mark.parametrize(
    ("case", "verdict", "wrong"),
    [
        (ReadingCase("a", known(1.0, 1.003)), "right", ""),
        (ReadingCase("a", known(1.0, 1.005)), "right", "it deviates from its reference"),
        (ReadingCase("a", known(math.nan, 1.0)), "right", "it deviates from its reference"),
        (ReadingCase("a", known(1.0, 1.0), refused=True), "right", "it should be refused"),
        (ReadingCase("a", refusing(InputError("so.")), refused=True), "refused: so.", ""),
        (ReadingCase("a", refusing(ComputationError("so."))), "refused: so.", "it should not be refused"),
    ],
)
def test_what_becomes_of_a_case(case, verdict, wrong):
    row = case.measured()
    assert (row.verdict, row.wrong) == (verdict, wrong) and row.seconds >= 0 and row.megabytes > 50
    if wrong:
        with pytest.raises(ComputationError, match="1 of 1 rows are wrong: a."):
            check([row])
    else:
        check([row])


@pytest.mark.parametrize(
    "part",
    [
        "plate 1e-5 mm",
        "VCNT2020",
        "LED of 1e-7 W",
        "force of 1e-09 N",
        "roof pressed onto",
        "million load steps",
        "relaxation times of 1e-6 and 1e6 s",
        "of which 1e-6 remains",
    ],
)
def test_rows_of_the_table_are_right(llvm_mono, tmp_path, monkeypatch, part):
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path))
    cases = [case for case in reading_cases() if part in case.name]
    for row in (case.measured() for case in cases):
        assert row.wrong == "", row
    assert cases


def test_a_row_comes_from_a_process_of_its_own():
    (case,) = (case for case in reading_cases() if "plate on the LED" in case.name)
    row = isolated_process.measure_isolated(case)
    assert row.wrong == "" and row.verdict == "right; said so"


def test_every_case_can_be_sent_to_a_process_and_has_a_name_of_its_own():
    cases = reading_cases()
    assert len({case.name for case in cases}) == len(cases) > 20
    for case in cases:
        assert pickle.loads(pickle.dumps(case)).name == case.name


def test_rows_as_files(tmp_path):
    row = ReadingRow("a | b", "right", power=1.5, error=1e-3, reference=1.5, deviations=0.2, by="hand")
    assert cells(row)[2:6] == ["1.50000e+00", "1.0e-03", "1.50000e+00", "+0.2"]
    write_markdown([row], tmp_path / "t.md", "taxel bench stability", "All cases are measured.")
    page = (tmp_path / "t.md").read_text()
    assert "## Readings" in page and "## Mechanics" not in page and r"a \| b" in page
    assert f"| {' | '.join(headings(ReadingRow))} |" in page
    write_csv([row], tmp_path / "t.csv")
    assert re.search(r"^a \| b,right,,", (tmp_path / "t.csv").read_text(), re.MULTILINE)


def test_running_sums_stand_still_in_single_precision():
    """Beyond 2^24 times its summands such a sum grows ever less; up to there it is right to a percent."""
    assert abs(running_sum_error(1 << 22)) < 0.01
    assert running_sum_error(1 << 26) > 0.2
