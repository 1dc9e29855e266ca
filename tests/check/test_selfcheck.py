"""The checks of `taxel doctor` pass here, and fail when what they check is broken."""

from __future__ import annotations

from mitsuba_taxel.check import selfcheck
from mitsuba_taxel.mechanics import NeoHookean


def test_checks_pass():
    for check in selfcheck.run_checks():
        assert check.passed, check


def test_a_wrong_law_is_noticed(monkeypatch):
    right = NeoHookean.stress
    monkeypatch.setattr(NeoHookean, "stress", lambda *arguments: 1.001 * right(*arguments))
    optics, mechanics = selfcheck.run_checks()
    assert optics.passed and not mechanics.passed


def test_a_check_that_breaks_off_has_failed(monkeypatch):
    def break_off(*_, **__):
        raise RuntimeError("no light")

    monkeypatch.setattr("mitsuba_taxel.sensing.measure", break_off)
    optics, _ = selfcheck.run_checks()
    assert not optics.passed and optics.detail == "RuntimeError: no light"
