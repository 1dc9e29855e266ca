"""What takes the time of the mechanics."""

from __future__ import annotations

from mitsuba_taxel.bench.peers.mechanics import NORMAL, TABLES, _parts
from mitsuba_taxel.mechanics.elements.solvers import Rslab
from mitsuba_taxel.pads import Pad


def test_parts_of_the_time_are_less_than_the_whole(tmp_path, monkeypatch):
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path))
    factor = Rslab.factor
    total, factors, checks, second = _parts(Pad(rows=1, columns=1, wall=0.93), NORMAL[:3])
    assert 0 < factors < total and 0 < checks < total and 0 < second < total
    assert Rslab.factor is factor and "parts" in TABLES
