"""Processor time of ramps, of one coarse cell."""

from __future__ import annotations

from mitsuba_taxel.bench import ramp
from mitsuba_taxel.pads import Pad


def test_all_three_ways_are_timed(monkeypatch):
    monkeypatch.setattr(ramp, "ROWS", 10)
    found = ramp.ramp(Pad(rows=1, columns=1))
    assert min(found.each, found.elastic, found.viscoelastic) > 0
