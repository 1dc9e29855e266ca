"""Processor time of ramps, of one coarse cell."""

from __future__ import annotations

from mitsuba_taxel.bench import ramp
from mitsuba_taxel.pads import Pad


def test_what_is_solved_costs_more_than_what_is_interpolated(monkeypatch):
    monkeypatch.setattr(ramp, "ROWS", 10)
    found = ramp.ramp(Pad(rows=1, columns=1))
    assert found.each > found.elastic > 0
    assert found.viscoelastic > 0
