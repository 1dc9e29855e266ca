"""Text of the subcommands, in a terminal and in a pipe."""

from __future__ import annotations

import pytest
from taxel_cli import tables

pytestmark = pytest.mark.quick

PROSE = "The noise before the converter is less than half of its step: " + "what is stated is a resolution, and " * 3


@pytest.mark.parametrize("width", [100, 60, None])
def test_lines_fit_the_terminal_and_stay_whole_in_a_pipe(monkeypatch, capsys, width):
    monkeypatch.setattr(tables, "terminal_width", lambda: width)
    row = "1      3.404312e-03          5.3e-06"
    tables.say(f"{PROSE}\n\n{row}")
    shown = capsys.readouterr().out.splitlines()
    assert shown[-2:] == ["", row] and " ".join(shown[:-2]).split() == PROSE.split()
    assert len(shown) == 3 if width is None else max(map(len, shown)) <= width < len(PROSE)


@pytest.mark.parametrize(
    ("heights", "answer"),
    [
        ([9e-4], "1 deformed pad: the error of the roofs is 9.0e-04 mm and 0.33 degrees."),
        ([1e-4, 2e-3], "2 deformed pads: the error of the roofs is 2.0e-03 mm and 0.33 degrees."),
        ([1e-4, None], "2 deformed pads: the error of the roofs is unknown."),
    ],
)
def test_the_answer_on_deformed_pads_is_the_largest_error(capsys, heights, answer):
    row = {"quantity": "force", "unit": "N", "value": [0, 0, -1], "min_jacobian": 0.9, "residual": 1e-9, "stable": True}
    row |= {"imbalance": 1e-9, "time_s": None, "slope_error_degrees": 0.33}
    tables.print_pads([{**row, "file": "a.ply", "roof_error_mm": height} for height in heights])
    first, blank, heading, *_ = capsys.readouterr().out.splitlines()
    assert (first, blank, heading.split()[0]) == (answer, "", "file")
