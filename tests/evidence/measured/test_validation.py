"""Simulated sensors beside measured ones: the page from made-up cycles."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.electronics import Circuit
from mitsuba_taxel.evidence.measured import cycles, measured, memory_fit, validation
from mitsuba_taxel.evidence.measured.page import memory as page_memory
from mitsuba_taxel.evidence.measured.page import rest as page_rest
from mitsuba_taxel.evidence.measured.rest_spread import SOURCES, Spread
from mitsuba_taxel.evidence.measured.sideways import FORCES, largest_slope


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


def test_a_ratio_that_is_not_resolved_has_a_bound():
    assert validation._resolved(2.0, 0.5) == "2.00 ± 0.50"
    assert validation._resolved(2.0, 3.0) == "not resolved, below 8"
    assert validation._resolved(np.nan, np.nan) == "not resolved"


@pytest.fixture
def sideways(make_study):
    """Readings of nine taxels that change by up to 1 % per N, alike to both sides, by the force's name."""
    forces, changes = np.array(FORCES), np.linspace(-0.01, 0.01, 9)
    return lambda along: make_study({along: forces}, 1e-3 * (1 + forces[:, None] * changes), 1e-9)


def test_volts_under_tangential_forces(sideways):
    """The circuit is linear here: 22 kOhm and 1 A/W, and 9 cells bear 9/12 of the force."""
    circuit = Circuit(supply=100.0, load_resistance=22e3, transfer=1.0)
    slope, error = largest_slope(sideways("fy"), circuit)
    assert slope == pytest.approx(22e3 * 1e-3 * 0.01 * 9 / 12, rel=1e-3)
    assert 0 < error < 0.05 * slope


def test_the_page_holds_all_parts(loop, sideways, monkeypatch, tmp_path):
    monkeypatch.setattr(validation, "cycle", lambda store, cell, terms: loop)
    monkeypatch.setattr(validation, "pushed", lambda store, cell, along: sideways(along))
    memory = memory_fit.PronyFit(
        ((0.2, 0.05), (0.02, 0.5), (0.01, 5.0)),
        3,
        1.1 * memory_fit.measured_tail(),
        np.array([1.03, 1.01, 1.0, 1.0]),
        0.0005,
        memory_fit.HysteresisLoop(0.75, 0.8, 0.4, 0.25),
        memory_fit.HysteresisLoop(0.6, 0.7, 0.3, 0.1),
        1.2,
        memory_fit.MemoryErrors(
            np.full(8, 1e-3), np.full(4, 2e-3), 1e-4, memory_fit.HysteresisLoop(0.05, 0.06, 0.02, 0.01)
        ),
    )
    monkeypatch.setattr(memory_fit, "results", lambda store, press, late: memory)
    found = SimpleNamespace(late=0.1, modulus=0.5)
    compared = SimpleNamespace(fitted=SimpleNamespace(height=8.0), moved=None, found=found, taxels={})
    monkeypatch.setattr(validation, "results", lambda store: compared)
    rest = Spread(dict.fromkeys(SOURCES, "a law"), dict.fromkeys(SOURCES, 0.1), 35.0, 10.0, 3.0, 1.0, 33.0)
    monkeypatch.setattr(validation, "spread", lambda store: rest)
    monkeypatch.setattr(validation, "pad_section", lambda found, pictures: "## A real pad under its indenter")
    monkeypatch.setattr(validation, "tried", lambda store, found: {})
    monkeypatch.setattr(validation, "assumptions_section", lambda found, tried: "### Other assumptions")
    monkeypatch.setattr(validation, "first_loading", lambda store, press, late, taxel: None)
    monkeypatch.setattr(validation, "paper_loading", lambda store: None)
    monkeypatch.setattr(validation, "softening_section", lambda *studies: "### Mullins' effect in one cell")
    monkeypatch.setattr(validation, "predicted_path", lambda store, press, taxel: None)
    monkeypatch.setattr(validation, "held_map", lambda *made: None)
    monkeypatch.setattr(validation, "maps_section", lambda maps, own: "### All taxels while others are held")
    monkeypatch.setattr(validation, "weights", lambda store, height, modulus: None)
    monkeypatch.setattr(validation, "weights_section", lambda study, own: "## Dead weights")
    page = validation.write_validation(None, tmp_path, "taxel validate").read_text()
    for words in (
        "Mullins' effect in one cell",
        "VCNT2020",
        "its indenter",
        "Other assumptions",
        "hold, release and loop",
        "Tables 2 to 4",
        "up to 4 N on 12 cells",
        "10 to 17 times the predicted",
        "is 10 % of the measured value",
        "1.030 ± 0.002",
        "0.75 ± 0.05",
        "agrees within its scatter",
        "0.05 ± 0.01 %, as measured",
        "force by +20 %",
        "that excludes it",
        "varies by 15 %",
        "is narrower than the 33",
    ):
        assert words in " ".join(page.split())
    pictures = {file.stem for file in (tmp_path / "validation").iterdir()}
    assert pictures == {"vcnt2020", "memory", "sensitivities"}
    assert "nan" not in page


def made_memory(**changed):
    """A memory as measured, but for what is ``changed``."""
    forces = np.array(measured.HOLD_FORCES)[:, 0]
    loop = memory_fit.HysteresisLoop(
        measured.FORCE_LOOP,
        measured.ENERGY_LOST,
        measured.VOLTAGE_LOOP_AT_FORCE,
        measured.VOLTAGE_LOOP_AT_TRAVEL,
    )
    errors = memory_fit.MemoryErrors(np.zeros(8), np.zeros(4), 0.0, memory_fit.HysteresisLoop(0, 0, 0, 0))
    made = memory_fit.PronyFit(
        ((0.2, 0.05),), 3, memory_fit.measured_tail(), forces / forces[-1], 0.0, loop, loop, 1.0, errors
    )
    return made._replace(**changed)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, ["The hold agrees", "The loop agrees"]),
        ({"hold": np.array([1.2, 1.0, 1.0, 1.0])}, ["The hold **does not agree**"]),
        ({"held_change": 0.01}, ["1.00 ± 0.00 %, **not** as measured"]),
        (
            {"loop": memory_fit.HysteresisLoop(30, 30, 15, 15)},
            ["**The loop does not agree**: the measured widths are 0.25 to"],
        ),
    ],
)
def test_numbers_decide_what_the_page_says_of_hold_and_loop(changed, words, tmp_path):
    text = " ".join(page_memory.memory_section(made_memory(**changed), tmp_path).split())
    for expected in words:
        assert expected in text
    assert "Mullins" not in text  # that would widen loops


def test_widths_below_their_errors_are_no_part_of_the_verdict(tmp_path):
    errors = memory_fit.MemoryErrors(np.zeros(8), np.zeros(4), 0.002, memory_fit.HysteresisLoop(0.05, 0.06, 0.4, 0.4))
    made = made_memory(loop=memory_fit.HysteresisLoop(0.75, 0.8, 0.4, 0.25), errors=errors)
    text = " ".join(page_memory.memory_section(made, tmp_path).split())
    assert "10 to 11 times the predicted ones (2 of 4 widths are not resolved)" in text
    assert "0.00 ± 0.20 %, which does not resolve the measured change of at most 0.15 %" in text
    none = made._replace(errors=errors._replace(loop=memory_fit.HysteresisLoop(9, 9, 9, 9)))
    section = page_memory.memory_section(none, tmp_path)
    assert "No width of the loop is resolved." in section
    assert all(f"| {label} |" in section for label in ("force at equal travel", "energy of a cycle"))


def test_a_spread_that_tolerances_do_not_reach_is_said():
    rest = Spread(dict.fromkeys(SOURCES, "a law"), dict.fromkeys(SOURCES, 0.1), 15.0, 10.0, 1.0, 1.0, 12.0)
    text = " ".join(page_rest.rest_section(rest).split())
    assert "**does not lie between the two**." in text and "explain" not in text
