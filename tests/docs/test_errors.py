"""What the theory of errors says was measured is what the pages of the benchmarks say today."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.quick

DOCS = Path(__file__).parents[2] / "docs"
TEXT = " ".join((DOCS / "theory" / "errors.md").read_text(encoding="utf-8").split())


def rows(page: str, *headings: str) -> list[dict[str, str]]:
    """Those of the table of a page that has some headings."""
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    (start,) = (i for i, line in enumerate(lines) if line.startswith("| ") and set(headings) <= set(cells(line)))
    table = lines[start + 2 :]
    end = next((i for i, line in enumerate(table) if not line.startswith("| ")), len(table))
    return [dict(zip(cells(lines[start]), cells(line), strict=True)) for line in table[:end]]


def cells(line: str) -> list[str]:
    return line.strip("| ").split(" | ")


def percent(row: dict[str, str], heading: str) -> float:
    return float(row[heading].rstrip("%"))


@pytest.fixture(scope="module")
def settings():
    return [row for row in rows("coverage.md", "within twice") if row["readings"] != "-"]


def test_readings_that_are_within_what_they_state(settings):
    readings, within = (sum(int(row[name]) for row in settings) for name in ("readings", "within twice"))
    counted = f"Of {readings} readings in {len(settings)} settings, the true error of {within} is within twice"
    assert counted in TEXT


def test_readings_that_are_not(settings):
    missed = [(row["true"], row["stated"]) for row in settings if row["within twice"] != row["readings"]]
    listed = rows("theory/errors.md", "true error", "stated error")
    assert [(row["true error"], row["stated error"]) for row in listed] == [
        tuple(text.replace("%", " %") for text in pair) for pair in missed
    ]


def test_the_error_of_the_light(settings):
    light = sorted(row["light"].rstrip("%") for row in settings)
    assert f"the error of the light, {light[0]} to {light[-1]} %, is common to all" in TEXT


def test_readings_corrected_by_what_they_state():
    page = (DOCS / "coverage.md").read_text(encoding="utf-8")
    ((true, corrected),) = re.findall(r"true ([\d.]+)%, corrected ([\d.]+)%", page)
    assert f"would be {corrected} %, instead of {true} %" in TEXT


def test_mirrors_of_large_elements():
    pads = rows("domes.md", "deviation, 1.25 mm")
    worst = max(abs(percent(row, "deviation, 1.25 mm")) for row in pads)
    assert f"wrong by up to {worst:.1f} % over [six pads]" in TEXT and len(pads) == 6


def test_light_that_a_pressed_mirror_loses():
    domes = rows("domes.md", "N per cell")
    read = {
        row["N per cell"]: float(row["reference [W/W]"])
        for row in domes
        if (row["cell"], row["roof"], row["cells"]) == ("hemispheric", "mirror", "1 x 1")
    }
    assert f"loses {1 - read['-2'] / read['0']:.0%} of its light at -2 N".replace("%", " %") in TEXT
