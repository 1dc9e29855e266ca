"""What takes the time of the mechanics."""

from __future__ import annotations

from mitsuba_taxel.evidence.peers import mechanics as module
from mitsuba_taxel.evidence.peers.mechanics import NORMAL, TABLES, _parts
from mitsuba_taxel.mechanics.elements.solvers import Rslab, available_solvers
from mitsuba_taxel.pads import Pad


def test_parts_of_the_time_are_less_than_the_whole(tmp_path, monkeypatch):
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path))
    factor = Rslab.factor
    total, factors, checks, second = _parts(Pad(rows=1, columns=1, wall=0.93), NORMAL[:3])
    assert 0 < factors < total and 0 < checks < total and 0 < second < total
    assert Rslab.factor is factor and "parts" in TABLES


def test_solvers_at_hand_are_compared(monkeypatch):
    """On one cell; in this process."""
    monkeypatch.setattr(module, "CELL_SHAPES", ("parallelepiped",))
    monkeypatch.setattr(module, "Pad", lambda cell: Pad(cell, 1, 1))
    monkeypatch.setattr(module, "_isolated", lambda function, *arguments: (*function(*arguments), 100.0))
    _, *rows = TABLES["solvers"]()
    assert [row[1] for row in rows] == available_solvers() and rows[0][4] == "1.0"
    assert all(float(row[5]) < 1e-8 for row in rows)
