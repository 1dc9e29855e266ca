"""Simulated sensors beside measured ones: the memory found, and the page from made-up cycles."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.reproduce import cycles, measured, memory_fit, validation


def test_the_memory_found_follows_the_tail_and_foretells_the_hold():
    terms = memory_fit.fitted_terms()
    left = np.array(measured.TAIL_VOLTS) / (measured.HELD_SHARE * measured.PRESSES[measured.PRESSED].at_rest)
    np.testing.assert_allclose(memory_fit.tail(terms), left, rtol=0.12)
    forces, scatter = np.array(measured.HOLD_FORCES).T
    assert np.all(np.abs(memory_fit.hold(terms) - forces / forces[-1]) < scatter / forces[-1])


def test_a_slow_loop_is_as_wide_as_a_linear_solid_makes_it():
    """Far from the turns a term lags by tau, which opens 2 g tau of the force's rate."""
    terms = ((0.1, 0.5),)
    loop = memory_fit.slow_loop(terms)
    rate = 2 / measured.CYCLE_SECONDS  # of the largest force
    assert loop.width == pytest.approx(100 * 2 * 0.1 * 0.5 * rate, rel=0.4)  # the pad stiffens
    assert 0 < loop.energy < 2 * loop.width


@pytest.fixture
def loop():
    """A cycle whose readings are a line and a loop 4 % wide."""
    force = np.concatenate([np.arange(6), np.arange(4, -1, -1)]) * -1.5
    share = force / force.min()
    back = np.arange(11) > 5
    power = 1e-3 * (1 + 0.1 * (share + 0.16 * share * (1 - share) * back))[:, None] * np.linspace(0.9, 1.1, 9)
    replicates = np.repeat(power[:, None], 32, axis=1) * (1 + 1e-6 * np.random.default_rng(0).normal(size=(11, 32, 9)))
    return xr.Dataset(
        {
            "power": (("step", "taxel"), power),
            "total_error": (("step", "taxel"), 1e-3 * power),
            "replicate_power": (("step", "replicate", "taxel"), replicates),
        },
        coords={
            "step": np.arange(1, 12),
            "time": ("step", 10.0 * np.arange(11)),
            "fz": ("step", force),
            "taxel": range(1, 10),
        },
    )


def test_volts_of_a_cycle(loop):
    found = cycles.figures(loop)
    per_newton = measured.REST_VOLTAGE * 0.1 / 7.5 * cycles.CELLS / measured.CELLS_OF_EXPERIMENTS
    assert found.most == pytest.approx(1.1 * per_newton, rel=0.03)
    assert found.least == pytest.approx(0.9 * per_newton, rel=0.03)
    assert found.hysteresis[0] == pytest.approx(4.0, abs=0.3)


def test_the_page_holds_all_parts(loop, monkeypatch, tmp_path):
    monkeypatch.setattr(validation, "cycle", lambda store, cell, terms: loop)
    monkeypatch.setattr(memory_fit, "slow_loop", lambda terms: memory_fit.Loop(0.5, 0.8))
    monkeypatch.setattr(validation, "results", lambda store: None)
    monkeypatch.setattr(validation, "pad_section", lambda found, pictures: "## A real pad under its indenter")
    page = validation.write_validation(None, tmp_path, "taxel validate").read_text()
    for words in ("VCNT2020", "its indenter", "hold, release and loop", "Tables 2 and 4", "15 times as wide"):
        assert words in page
    pictures = {file.stem for file in (tmp_path / "validation").iterdir()}
    assert pictures == {"vcnt2020", "memory", "sensitivities"}
    assert "nan" not in page
