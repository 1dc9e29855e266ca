"""Relaxation and loops of the measured pad, on made-up records and on one coarse cell."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.evidence.measured import bench_pad, bench_pad_in_time, measured, memory_fit
from mitsuba_taxel.evidence.measured.bench_pad import IndenterPress
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.mechanics import NeoHookean, Viscoelastic


def test_the_linear_tail_of_one_term_has_a_closed_form():
    """Strain creeps back slower than stress relaxes, by the share of the stiffness that remains."""
    share = 0.3
    expected = share * np.exp(-(1 - share) * np.array(measured.TAIL_TIMES) / memory_fit.TIMES[0])
    np.testing.assert_allclose(memory_fit.linear_tail(np.array([share, 0, 0])), expected, rtol=1e-9, atol=1e-12)


def test_shares_behind_a_tail_are_found_though_the_pad_is_not_linear(monkeypatch):
    true = (0.25, 0.03, 0.02)

    def computed(terms):
        shares = np.array([share for share, _ in terms])
        return np.linspace(0.7, 0.4, len(measured.TAIL_TIMES)) * memory_fit.linear_tail(shares) ** 1.1

    left = computed(tuple(zip(true, memory_fit.TIMES, strict=True)))
    monkeypatch.setattr(memory_fit, "measured_tail", lambda: left)
    terms, count = memory_fit.fit(computed)
    assert [share for share, _ in terms] == pytest.approx(true, rel=memory_fit.SETTLED)
    assert count <= 3


def test_widths_of_a_made_up_loop():
    travel = np.array([0.25, 0.5, 0.75, 1, 0.75, 0.5, 0.25])
    back = np.arange(7) > 3
    gap = 4 * travel * (1 - travel) * back
    change = np.zeros((7, 25))
    change[:, measured.PRESSED - 1] = 0.2 * travel + 0.01 * gap
    made = xr.Dataset(
        {"force": ("row", 2 * travel - 0.1 * gap), "change": (("row", "taxel"), change)},
        coords={"travel": ("row", travel), "taxel": np.arange(1, 26)},
    )
    loop = memory_fit.loop_of(made)
    # The area below 4 t (1 - t) by trapezia of a quarter is 5 / 8.
    assert loop == pytest.approx((5.0, 100 * 0.1 * 0.625, 100 * (0.01 + 0.01) / 0.2, 5.0), rel=1e-9)


def test_a_further_term_opens_the_loop_of_a_linear_solid():
    """By steps in time, where each term is a dashpot and a spring."""
    share, time, count = 0.3, 20.0, 20_000
    step = measured.CYCLE_SECONDS / 2 / count
    strain = np.concatenate([np.arange(count + 1), np.arange(count - 1, -1, -1)]) / count
    creep = np.zeros(len(strain))
    for k in range(1, len(strain)):
        middle = (strain[k] + strain[k - 1]) / 2
        creep[k] = (creep[k - 1] * (1 - step / 2 / time) + middle * step / time) / (1 + step / 2 / time)
    force = strain - share * creep
    width, relaxed = memory_fit._loop_per_share(time)
    assert force[count] == pytest.approx(1 - share * relaxed, rel=1e-6)
    widest = np.abs(force[: count + 1] - force[count:][::-1]).max()
    assert widest == pytest.approx(share * width, rel=1e-4)
    assert memory_fit.linear_loop(((share, time),)) == pytest.approx(100 * widest / force[count], rel=1e-4)


def test_errors_of_a_hold_are_those_of_elements_steps_and_light():
    times, tails = bench_pad_in_time.HOLD_TIMES, len(measured.TAIL_TIMES)
    rows = 1 + len(times) + 1 + tails

    def made(change, force, light, of_steps):
        left = np.concatenate([np.full(2 + len(times), 0.2), 0.2 * change * np.ones(tails)])
        return xr.Dataset(
            {
                "force": ("row", np.concatenate([[1.0], force * np.linspace(1.1, 1, len(times)), np.zeros(1 + tails)])),
                "change": (("row", "taxel"), left[:, None]),
                "change_error": (("row", "taxel"), np.full((rows, 1), light)),
                "step_error": ("row", np.full(rows, of_steps)),
            },
            coords={"taxel": [measured.PRESSED]},
        )

    travel = np.array([0.5, 1, 0.5])
    slow = xr.Dataset(
        {
            "force": ("row", [1.0, 2.0, 0.9]),
            "change": (("row", "taxel"), [[0.1], [0.2], [0.1]]),
            "change_error": (("row", "taxel"), np.full((3, 1), 1e-3)),
            "step_error": ("row", np.full(3, 1e-3)),
        },
        coords={"taxel": [measured.PRESSED], "travel": ("row", travel)},
    )
    study, finer = made(0.10, 1.0, 6e-4, 4e-3), made(0.11, 2.0, 6e-4, 0.0)
    errors = memory_fit.errors_of(study, finer, slow, slow)
    np.testing.assert_allclose(errors.tail, np.sqrt(0.01**2 + (6e-4 / 0.2) ** 2 + 4e-3**2))
    np.testing.assert_allclose(errors.hold, 4e-3)  # both fall alike
    assert errors.held_change == pytest.approx(3e-3)
    assert errors.loop == pytest.approx((0.2, 0.2, 0.5, 0.5))


@pytest.fixture
def small(monkeypatch):
    for module, name, value in (
        (bench_pad, "SIDE", 1),
        (bench_pad, "MESH_SIZE", 3.0),
        (bench_pad, "POINTS", 16),
        (bench_pad_in_time, "POINTS", 16),
        (bench_pad_in_time, "CYCLE_TRAVEL", 0.2),
        (bench_pad_in_time, "STEPS", 3),
        (measured, "HELD_AT", 0.2),
        (measured, "PRESSED", 1),
        (measured, "PAD_SIDE", 5.0),
    ):
        monkeypatch.setattr(module, name, value)


def test_force_of_a_hold_relaxes_as_the_series(small, tmp_path):
    """Nearly as that of an incompressible pad: after a quick press, its stress is a fixed field times the series."""
    terms = ((0.2, 0.5), (0.1, 5.0))
    study = bench_pad_in_time.hold_and_release(PaperStudies(tmp_path, str), IndenterPress(4.0, "sphere", 2.0), terms)
    times = np.array(bench_pad_in_time.HOLD_TIMES)
    expected = Viscoelastic(NeoHookean(), terms).relaxation(times + bench_pad_in_time.REACHED / 2)
    force = study.force.values[1 : 1 + len(times)]
    np.testing.assert_allclose(force / force[-1], expected / expected[-1], rtol=0.01)
    tail = memory_fit.tail_of(study)
    assert np.all(np.diff(tail) < 0)
    assert 0 < tail[-1] < tail[0] < 0.3


def test_a_slow_loop_is_as_wide_as_a_linear_solid_makes_it(small, tmp_path):
    """Far from the turns a term lags by tau, which opens 2 g tau of the force's rate."""
    share, time = 0.1, 0.5
    study = bench_pad_in_time.cycle(PaperStudies(tmp_path, str), IndenterPress(4.0, "sphere", 2.0), ((share, time),))
    loop = memory_fit.loop_of(study)
    rate = 2 / measured.CYCLE_SECONDS  # of the largest force
    expected = 100 * 2 * share / (1 - share) * time * rate
    assert loop.force == pytest.approx(expected, rel=0.5)  # contact makes the force steeper than its mean
    assert 0 < loop.energy < 2 * loop.force
    assert loop.change_at_travel < loop.change_at_force
