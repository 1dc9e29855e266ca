"""The table of stated and true errors of readings."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from taxel_cli.evidence.bench import command

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.coverage import coverage as table
from mitsuba_taxel.evidence.coverage import coverage_cases
from mitsuba_taxel.evidence.coverage.coverage import coverage
from mitsuba_taxel.evidence.coverage.coverage_row import CoverageRow, summary
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.evidence.rows.row_files import read_rows
from mitsuba_taxel.mechanics.contact.indenter_shape import IndenterShape
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.cells.cell_shape import CellShape
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

SUBSET = ("parallelepiped, 1 x 1, wall 0.5 mm, plate moved by 0.1 mm", "cylindrical, 1 x 1, wall 0.3 mm, -1 N")


def test_the_table_is_of_every_kind_of_pad_and_load():
    cases = coverage_cases.coverage_cases()
    names = [case.name for case in cases]
    assert len(names) == len(set(names)) >= 86
    assert {case.sensor.pad.wall for case in cases} >= {0.3, 0.5, 0.7} and {case.file_format for case in cases} > {""}
    assert len({type(case.sensor.load) for case in cases}) == 8 and any("2 x 5" in name for name in names)


def test_every_registered_kind_is_in_the_table():
    """A body from a file needs one."""
    sensors = [case.sensor for case in coverage_cases.coverage_cases()]
    assert {sensor.pad.cell for sensor in sensors} == set(CellShape.kinds())
    assert {getattr(sensor.material, "law", sensor.material).name for sensor in sensors} == set(Material.kinds())
    assert {sensor.load.name for sensor in sensors} == set(Load.kinds())
    bodies = {sensor.load.indenter.shape for sensor in sensors if sensor.load.indenter is not None}
    assert bodies == set(IndenterShape.kinds()) - {"file"}


def test_every_shape_that_can_be_rounded_has_a_fillet_in_the_table():
    """Domes without an edge between roof and side have none."""
    pads = [case.sensor.pad for case in coverage_cases.coverage_cases()]
    assert {pad.cell for pad in pads if pad.fillet} == set(CellShape.kinds()) - {"hemispheric", "profile"}


def test_every_shape_has_a_rounded_mouth_in_the_table():
    pads = [case.sensor.pad for case in coverage_cases.coverage_cases()]
    blunt = [pad for pad in pads if pad.mouth_fillet]
    assert {pad.cell for pad in blunt} == set(CellShape.kinds())
    assert all(pad.outer_fillet for pad in blunt)


def test_pads_of_files_are_those_of_the_file(llvm_mono, tmp_path):
    case = next(case for case in coverage_cases.coverage_cases() if case.file_format == ".stl")
    (pad,) = deformed_pads(case._from_file(tmp_path).load())
    low, high = pad.bbox().min, pad.bbox().max
    assert pad.is_loaded and high.x - low.x == pytest.approx(case.sensor.pad.extent[0], rel=0.05)


def test_readings_are_within_twice_what_they_state(llvm_mono, monkeypatch):
    """Two settings of `taxel bench coverage`, under which the stated error was once a fifth of the true one.

    On elements half as large and less, the truth is right to a tenth of what is compared. `tests/sensing` has forces on
    all shapes of cells with thicker walls.
    """
    monkeypatch.setattr(coverage_cases, "FINE", 0.6)
    rows = [case.measured() for case in coverage_cases.coverage_cases() if case.name in SUBSET]
    assert len(rows) == len(SUBSET) and not any(row.remark for row in rows)
    assert sum(row.within for row in rows) == sum(row.readings for row in rows), rows
    assert all(0 < row.true < 0.02 and 1e-5 < row.stated < 0.03 > row.corrected and row.seconds > 0 for row in rows)


@pytest.mark.parametrize("ratios", [[1.4], [1.01, 1.5], [1.01, 1.02, 1.2]])
def test_meshes_of_a_reference_differ_enough_to_extrapolate(ratios, monkeypatch):
    """Of errors that fall with the assumed power of the size, the extrapolation leaves nothing. Fillets may give two
    sizes the same mesh; one reading more is then taken, on larger elements."""
    (case, *_), left, sizes = coverage_cases.coverage_cases(), list(ratios), iter([1.0, *ratios])
    power = (np.array([1 + 0.01 * size**coverage_cases.ORDER]) for size in sizes)
    shape = SimpleNamespace(state=SimpleNamespace(mesh=None))
    monkeypatch.setattr(coverage_cases, "_read", lambda _: (SimpleNamespace(power=next(power)), shape))
    monkeypatch.setattr(coverage_cases, "size_ratio", lambda *_: left.pop(0))
    truth, extrapolated = case._truth(0.4, 1.25)
    assert not left and not list(sizes)
    assert truth == pytest.approx(1.0) and extrapolated == pytest.approx(0.01)


def test_meshes_of_a_reference_that_are_all_the_same_are_a_remark(monkeypatch):
    case, *_ = coverage_cases.coverage_cases()
    same = SimpleNamespace(power=np.ones(1), mechanics_error=0), SimpleNamespace(state=SimpleNamespace(mesh=None))
    monkeypatch.setattr(coverage_cases, "_read", lambda *_, **__: same)
    monkeypatch.setattr(coverage_cases, "size_ratio", lambda *_: 1.01)
    with pytest.raises(ComputationError, match="no two meshes"):
        case._truth(0.4, 1.25)


@pytest.fixture
def made_up(monkeypatch):
    """Rows in place of measured ones; the names of those asked for."""
    asked = []

    def measure(case, seconds, memory):
        asked.append(case.name)
        if "0.3" in case.name:
            return CoverageRow(case.name, "no", seconds=1.0)
        return CoverageRow(case.name, "", 9, 2e-3, 3e-3, 1e-3, 0, 0, 4, 3)

    monkeypatch.setattr(table, "measure_isolated", measure)
    return asked


def test_rows_that_a_file_holds_are_not_measured_again(tmp_path, made_up):
    file, page = tmp_path / "rows.csv", tmp_path / "page.md"
    first = list(coverage("spherical, 1 x 1, wall 0.5 mm, -1 N", file))
    assert made_up == ["spherical, 1 x 1, wall 0.5 mm, -1 N"]
    assert read_rows(file, CoverageRow)[made_up[0]].ratio == first[0].ratio
    rows = list(coverage("spherical, 1 x 1, wall 0.[35] mm, -1 N", file, page))
    assert len(made_up) == 2 and len(rows) == 2 and math.isnan(rows[1].true)
    list(coverage("spherical, 1 x 1, wall 0.[35] mm, -1 N", file, page))
    assert len(made_up) == 3  # what failed is tried again
    text = page.read_text()
    assert "3 of 4 readings (75.0%) in 1 settings are within twice the stated error; 1 settings could not" in text
    assert "true 0.200%, corrected 0.300%" in page.read_text()
    assert "| 0.200% | 0.300% | 0.100% | 2.00 |" in page.read_text()
    assert summary(rows[1:]).startswith("0 of 0 readings in 0")


def test_a_file_of_something_else_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="a file of rows that this command wrote is needed"):
        next(coverage(None, tmp_path / "a.csv"))


def test_the_command_prints_the_table(made_up):
    done = CliRunner().invoke(command, ["coverage", "--only", "2 x 2"], obj=None)
    assert done.exit_code == 0, done.output
    assert "12 of 16" in done.output or "9 of 12" in done.output
    assert len(cells(CoverageRow("a"))) == len(headings(CoverageRow))


def test_the_page_has_95_percent_within_twice():
    """Of readings, and of settings in which all are; each truth is on elements of at most 0.4 mm."""
    lines = (Path(__file__).parents[3] / "docs" / "coverage.md").read_text().splitlines()
    first = lines[: lines.index("## Results that need no pad")]
    headings_there, _, *rows = [line.strip("| ").split(" | ") for line in first if line.startswith("| ")]
    told = [dict(zip(headings_there, row, strict=True)) for row in rows]
    names = [case.name for case in coverage_cases.coverage_cases()]
    measured = [row["setting"] for row in told]
    assert measured == [name for name in names if name in measured]
    read = [row for row in told if row["readings"] != "-"]
    assert len(read) >= 74 and all("needs random paths" in row["remark"] for row in told if row not in read)
    readings, within = (np.array([int(row[name]) for row in read]) for name in ("readings", "within twice"))
    assert within.sum() >= 0.95 * readings.sum() and np.mean(within == readings) >= 0.95
    assert max(coverage_cases.FINE, *coverage_cases.FINE_OF_DOMES.values()) <= 0.4
