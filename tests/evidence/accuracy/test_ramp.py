"""Processor time of ramps, of one coarse cell."""

from __future__ import annotations

from types import SimpleNamespace

from mitsuba_taxel.evidence.accuracy import ramp
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.pads import Pad


def test_what_is_solved_costs_more_than_what_is_interpolated(monkeypatch):
    """By a clock that counts states."""
    solved, balanced = [], LoadedPad._balanced

    def counted(pad, *how):
        solved.append(pad)
        return balanced(pad, *how)

    monkeypatch.setattr(LoadedPad, "_balanced", counted)
    monkeypatch.setattr(ramp, "ROWS", 12)
    monkeypatch.setattr(ramp, "time", SimpleNamespace(process_time=lambda: len(solved)))
    found = ramp.ramp(Pad(rows=1, columns=1))
    assert found.each >= ramp.ROWS > found.elastic > 0
    assert found.viscoelastic > 0
