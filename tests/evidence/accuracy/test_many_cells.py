"""The table of pads of many cells: growth of times that is known, and one row against its pad."""

from __future__ import annotations

import math
import time

import pytest

from mitsuba_taxel.evidence.accuracy import many_cells
from mitsuba_taxel.evidence.accuracy.many_cells import ManyCells, ManyCellsRow, growth, growth_line
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.mechanics.meshes import pad_mesh
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.reading.readings import Readings


@pytest.mark.parametrize("power", [1.0, 1.27])
def test_growth_is_the_power_of_times_that_follow_one(power):
    """Pads that were not read do not count, and one pad has no growth."""
    rows = [
        ManyCellsRow(f"{n} x {n}", n * n, mechanics=0.2 * time, second_mesh=0.1 * time, reading=0.3 * time)
        for n, time in ((n, n ** (2 * power)) for n in (3, 6, 12, 32))
    ]
    assert growth([*rows, ManyCellsRow("40 x 40", 1600, "out of memory")]) == pytest.approx(power)
    assert growth_line(rows) == f"CPU time grows as the number of cells to the power of {power:.2f}."
    assert math.isnan(growth(rows[:1])) and growth_line(rows[:1]) == ""


@pytest.mark.parametrize("under_ball", [False, True])
def test_a_row_is_of_its_pad(under_ball, llvm_mono, monkeypatch):
    """Its errors are those of the reading, its time that of the process; a ball has smaller elements under it."""
    seen, measure = [], many_cells.measure
    monkeypatch.setattr(many_cells, "measure", lambda scene: seen.append(measure(scene)) or seen[-1])
    start = time.process_time()
    row = ManyCells(1, under_ball).measured()
    seconds = time.process_time() - start
    (reading,), elements = seen, len(pad_mesh(Pad(rows=1, columns=1), 1.25).tets)
    assert isinstance(reading, Readings)
    assert row.elements > 1.2 * elements if under_ball else row.elements == elements
    assert row.mechanics_error == pytest.approx(reading.error_budget["mechanics"])
    assert row.light_error == pytest.approx(math.hypot(*(reading.error_budget[key] for key in ("light", "geometry"))))
    assert cells(row)[0].startswith("1 x 1, ") and cells(row)[-1] == "read"
    assert 0 < row.mechanics_error < 0.01 and row.megabytes > 100
    assert 0.9 * seconds < row.seconds <= seconds  # meshes and kernels may be those of other tests


def test_what_does_not_fit_is_a_row(monkeypatch):
    monkeypatch.setattr(many_cells, "measure_isolated", lambda case, limit, memory: case.failed(f"after {limit:g} s"))
    names = []
    (row,) = many_cells.many_cells([40], False, 7.0, names.append)
    assert cells(row) == ["40 x 40, spread force", *["-"] * 7, "after 7 s"] and len(headings(ManyCellsRow)) == 9
    assert row.cells == 1600 and names == ["40 x 40, spread force"]
