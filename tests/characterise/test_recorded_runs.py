"""Recorded cycles with known figures of merit: where they turn, what they say, and how well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas
import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.characterise import Measurement, characteristics, recorded_experiment
from mitsuba_taxel.characterise.recorded.recorded_noise import step_of

REPLICATES = 64


def figures(measurements) -> pandas.DataFrame:
    return pandas.concat([characteristics([recorded_experiment(one)]) for one in measurements])


@pytest.mark.parametrize("rows, pause", [(2500, 150), (400, 20), (2500, 0), (30, 1), (12, 1)])
@pytest.mark.parametrize("cycles", [1, 3])
def test_runs_are_told_apart(record, rows, pause, cycles):
    found = recorded_experiment(record(rows=rows, pause=pause, cycles=cycles))
    assert [branch.loading for branch in found.branches] == [True, False] * cycles
    for run in found.runs:
        np.testing.assert_allclose(sorted(run.force[[0, -1]]), [0, 10], atol=0.1)


@pytest.mark.parametrize("newtons", [0.0, 0.01, 0.1, 0.5])
def test_noise_of_the_force_is_no_turning_point(record, newtons):
    assert len(recorded_experiment(record(newtons=newtons)).runs) == 4


@pytest.mark.parametrize(
    "how",
    [{}, {"volts": 4e-3}, {"newtons": 0.05, "volts": 3e-4}, {"pause": 0}, {"rows": 800}],
    ids=["as usual", "noisy voltage", "noisy force", "no pauses", "few rows"],
)
def test_known_figures_are_found(record, covered, how):
    """8 records of 4 taxels."""
    table = figures(record(seed, taxels=4, **how) for seed in range(8))
    truth = {"mean_slope": 0.03, "nonlinearity": 7.5, "hysteresis": 5, "repeatability": 0}
    for name, value in truth.items():
        rows = table[table.figure == name]
        # Records without a pause lack 0.3 % of the range; the choice of the largest may leave half an error.
        covered(rows.value, rows.error, value, REPLICATES, at_least=0.86)
        assert abs(rows.value.mean() - value) < 0.005 * value + 0.6 * rows.error.mean(), name
    steepest = table[table.figure == "max_slope"]
    assert abs(steepest.value.mean() - 0.0386) < 0.5 * steepest.error.mean() + 2e-4


@pytest.mark.parametrize("drift", [0.02, -0.04])
def test_a_drift_between_cycles_is_lack_of_repeatability(record, drift):
    table = figures(record(seed, drift=drift) for seed in range(5))
    found = table[table.figure == "repeatability"]
    expected = 100 * abs(drift) / max(1, 1 - drift)
    assert abs(found.value.mean() - expected) < 5 * found.error.mean() / np.sqrt(len(found))
    assert found.at_N.median() > 9


def test_noise_that_is_not_white_is_in_the_errors(record):
    """Neighbouring rows correlated by 0.9: errors of means are four times those of white noise."""
    from scipy.signal import lfilter

    clean, noisy = record(volts=0.0), record(volts=1e-3)
    slow = lfilter([np.sqrt(0.19)], [1, -0.9], noisy.voltage - clean.voltage, axis=0)
    found = [recorded_experiment(one) for one in (replace(clean, voltage=clean.voltage + slow), noisy)]
    assert found[0].notes[-1].endswith("errors contain it, roughly.") and "correlated" not in " ".join(found[1].notes)
    tables = [characteristics([one]) for one in found]
    slopes, white = (table[table.figure == "mean_slope"] for table in tables)
    assert 2.5 < slopes.error.mean() / white.error.mean() < 6
    assert (np.abs(slopes.value - 0.03) < 4 * slopes.error).all()


def test_few_rows_have_no_error(record):
    table = figures([record(rows=21, pause=1, volts=0.0, newtons=0.0, cycles=1)])
    assert table.error.isna().all()
    np.testing.assert_allclose(table[table.figure == "nonlinearity"].value, 7.5, rtol=1e-6)
    np.testing.assert_allclose(table[table.figure == "hysteresis"].value, 5, rtol=1e-6)


def test_a_staircase(record):
    """Eleven weights put on and taken off, 60 readings of each."""
    once = record(rows=2501, pause=0, volts=0.0, newtons=0.0, cycles=1)
    rows = np.concatenate([np.arange(0, 2501, 250), np.arange(2501, 5002, 250)[1:]]).repeat(60)
    rng = np.random.default_rng(1)
    stairs = replace(
        once,
        time=np.arange(len(rows)) / 10.0,
        force=once.force[rows] + 0.005 * rng.normal(size=(len(rows), 1)),
        voltage=once.voltage[rows] + 1e-3 * rng.normal(size=(len(rows), 2)),
    )
    found = recorded_experiment(stairs)
    assert [len(run.force) for run in found.runs] == [11, 11]
    table = characteristics([found])
    for name, truth in (("nonlinearity", 7.5), ("hysteresis", 5)):
        rows = table[table.figure == name]
        assert (np.abs(rows.value - truth) < 5 * rows.error).all() and (rows.error < 0.3).all()


@pytest.mark.parametrize("levels, hold", [(4, 3), (11, 30), (40, 200)])
@pytest.mark.parametrize("newtons", [0.0, 2e-3])
def test_each_hold_is_a_point(levels, hold, newtons):
    """Whatever the places of levels among evenly spaced forces; nominal forces have no noise."""
    rng = np.random.default_rng(levels)
    up = np.linspace(0, 2, levels)
    force = np.concatenate([up, up[-2::-1], up[1:], up[-2::-1]]).repeat(hold)
    voltage = 0.75 - 0.04 * (0.9 * force + 0.05 * force**2) + 2e-4 * rng.normal(size=force.size)
    force = -force + newtons * rng.normal(size=force.size)
    time = np.arange(force.size) / 10
    found = recorded_experiment(Measurement(time, force[:, None], ("fz",), voltage[:, None], np.array([1]), "bench"))
    assert [len(run.force) for run in found.runs] == [levels] * 4
    assert np.abs(np.sort(-found.runs[0].force) - up).max() < 5 * newtons / np.sqrt(hold / 2) + 1e-12
    table = characteristics([found])
    for figure, truth in (("mean_slope", 0.04), ("zero_slope", 0.036)):
        rows = table[table.figure == figure]
        assert (np.abs(rows.value - truth) < 5 * rows.error).all() and (rows.error > 0).all()


def test_changes_are_those_from_the_least_force(record):
    """A record that begins at the top of a cycle has the same relative slope; one that is never unloaded says so."""
    whole = record(rows=500, pause=50, volts=1e-4, newtons=1e-3)
    late = slice(575, None)
    found = recorded_experiment(
        replace(whole, time=whole.time[late], force=whole.force[late], voltage=whole.voltage[late])
    )
    (first, *_), expected = (
        characteristics([one]).query("figure == 'relative_slope'").value.to_numpy()[::2]
        for one in (found, recorded_experiment(whole))
    )
    assert first == pytest.approx(expected[0], rel=2e-3) and not any("without load" in note for note in found.notes)
    biased = recorded_experiment(replace(whole, force=whole.force + 1))
    assert biased.notes[-1].startswith("The recording has no unloaded state") and "1 N" in biased.notes[-1]


def test_a_relative_slope_refers_to_the_end_of_a_moving_force():
    """Of records from 2 N to 10 N and down to 0 N, the reading at rest was that at up to 0.02 N: the errors of relative
    slopes were 1.7 stated errors."""
    ratios = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        rows = int(rng.integers(100, 600))
        force = np.concatenate([np.linspace(2, 10, rows), np.linspace(10, 0, int(1.25 * rows))])
        voltage = 1 - 0.0594 * force + 1e-4 * rng.normal(size=force.size)
        bench = Measurement(np.arange(force.size) / 50, force[:, None], ("fz",), voltage[:, None], np.array([1]), "")
        slope = characteristics([recorded_experiment(bench)]).groupby("figure").first().loc["relative_slope"]
        ratios.append((slope.value + 5.94) / slope.error)
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.4  # each bound: once in a thousand times


def test_steps_of_a_converter_are_recognised():
    """Also where no two neighbouring voltages occur; of noise there are none."""
    rng = np.random.default_rng(0)
    codes = rng.integers(0, 400, 3000)
    assert step_of(codes * 8e-4 + 0.1) == pytest.approx(8e-4)
    assert step_of(np.round(codes * 8.0566e-4, 5)) == pytest.approx(8.0566e-4, rel=1e-4)
    assert step_of(np.repeat([0, 2, 5, 9, 13], 10) * 1e-3) == pytest.approx(1e-3)
    assert step_of(rng.normal(size=3000)) == 0 and step_of(np.repeat(rng.normal(size=40), 30)) == 0


def test_pushing_and_pulling(record):
    """0 -> 10 -> -10 -> 0 N: four branches on two sides, hysteresis on each."""
    once = record(cycles=1, pause=0)
    both = replace(
        once,
        time=np.arange(2 * len(once.time)) / 50,
        force=np.concatenate([once.force, -once.force]),
        voltage=np.concatenate([once.voltage, 2.4 - once.voltage]),
    )
    found = recorded_experiment(both)
    assert len(found.runs) == 3 and [part.side for part in found.branches] == [1, 1, -1, -1]
    table = characteristics([found])
    assert list(table[table.figure == "hysteresis"].loading) == [1, 1, 2, 2]
    np.testing.assert_allclose(table[table.figure == "hysteresis"].value, 5, atol=0.6)
    assert not len(table[table.figure == "repeatability"])


def test_three_components_along_one_line(record):
    """A diagonal load, of which the reference sensor feels 2 % across."""
    one = record()
    force = one.force * np.array([-0.7071, -0.7071, 0.02])
    found = recorded_experiment(replace(one, force=force, force_names=("fx", "fy", "fz")))
    assert found.force == "0.707 fx + 0.707 fy" and found.direction[2] == 0
    assert [branch.side for branch in found.branches] == [-1] * 4
    table = characteristics([found])
    np.testing.assert_allclose(table[table.figure == "mean_slope"].value, -0.03, rtol=0.01)


def test_a_load_that_bends_or_does_not_change_is_refused(record):
    one = record()
    bent = np.stack([one.force[:, 0], np.sqrt(np.abs(one.force[:, 0])) * 3, 0 * one.force[:, 0]], axis=1)
    bent[: len(bent) // 2, 1] = 0
    with pytest.raises(InputError, match="bench.csv.*several directions"):
        recorded_experiment(replace(one, force=bent, force_names=("fx", "fy", "fz")))
    for force in (0 * one.force, np.random.default_rng(1).normal(size=one.force.shape)):
        with pytest.raises(InputError, match="bench.csv.*no more than its noise"):
            recorded_experiment(replace(one, force=force))
