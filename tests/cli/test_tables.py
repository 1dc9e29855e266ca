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
