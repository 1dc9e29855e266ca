"""The table of bodies that are dragged to a position and pressed in there: its states, one of them, and its page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from click.testing import CliRunner
from taxel_cli.evidence.bench import command

from mitsuba_taxel.evidence.coverage import drags
from mitsuba_taxel.evidence.coverage.drags import DragCase, DragRow
from mitsuba_taxel.mechanics import Indenter, local_mesh
from mitsuba_taxel.mechanics.contact.indenter_shape import IndenterShape
from mitsuba_taxel.pads.cells.cell_shape import CellShape


def test_states_are_of_every_kind_and_radius():
    cases = drags.drag_cases()
    assert cases == drags.drag_cases() and len(cases) == len({case.name for case in cases})
    assert {case.cell for case in cases} == set(CellShape.kinds())
    assert {case.body.shape for case in cases} == set(IndenterShape.kinds()) - {"file"}
    assert {case.body.radius for case in cases} >= {0.3, 0.5, 1.0, 3.0}
    assert all(case.position[2] < 0 and not case.body.friction for case in cases)


def test_states_that_were_measured_stay():
    """The table of the documentation, whose rows are kept, has these states."""
    page = (Path(__file__).parents[3] / "docs" / "drags.md").read_text()
    states = {line.split(" | ")[0].removeprefix("| ") for line in page.splitlines() if " mm deep |" in line}
    assert len(states) >= 7 and states <= {case.name for case in drags.drag_cases()}


def test_a_dragged_ball_is_as_one_pressed_there(monkeypatch, tmp_path):
    """On few elements, whose errors are larger."""
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path))
    monkeypatch.setattr(local_mesh, "FINENESS", 1.3)
    row = DragCase("hemispheric", Indenter("sphere", radius=3.0), (0.2, 0.0, -0.05)).measured()
    assert not row.remark and row.deviates < 1 and 0 < row.force_off < 0.1 and 0 < row.roof_off < 0.1, row


def made_up(case, **changed):
    return replace(DragRow(case.name, "", 0.2, 0.004, 0.01, 0.002, 0.01, 20.0), **changed)


def test_the_page_counts_what_agrees(monkeypatch, tmp_path):
    changes = iter([{}, {"force_off": 0.021}, {"roof_off": 0.031, "roof_stated": 0.04}, {"remark": "no"}])
    monkeypatch.setattr(drags, "measure_isolated", lambda case: made_up(case, **next(changes)))
    page, rows = tmp_path / "page.md", tmp_path / "rows.csv"
    few = drags.drag_cases()[:4]
    monkeypatch.setattr(drags, "drag_cases", lambda: few)
    asked = ["drags", "--only", "ball", "--csv", str(rows), "--markdown", str(page)]
    result = CliRunner().invoke(command, asked)
    assert result.exit_code == 0, result.output
    again = CliRunner().invoke(command, asked)  # nothing is measured, as there are no changes left
    assert again.exit_code == 0 and again.stdout == result.stdout
    for text in (result.output, page.read_text()):
        assert (
            "1 of 3 states agree within 2 combined errors and 3%; 1 could not be solved; 4 of 4 states were run" in text
        )


def test_a_pattern_that_matches_nothing_is_refused():
    assert CliRunner().invoke(command, ["drags", "--only", "torus"]).exit_code != 0
