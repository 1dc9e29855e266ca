"""Imperfect readings against closed forms: step responses, variances, correlations and counts."""

from __future__ import annotations

import math

import numpy as np
import pandas
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.electronics import Circuit
from mitsuba_taxel.electronics.noise import noise_parts
from mitsuba_taxel.surrogates import ImperfectPads, PadMemory, PadSpread, read_spread

pytestmark = pytest.mark.quick

REST = np.array([2e-3, 5e-3])
LINEAR = Circuit(supply=5.0, load_resistance=1000.0, transfer=0.2, saturation_voltage=0.0, bandwidth=50.0, adc_bits=12)
"""0.2 V per mW."""


@pytest.mark.parametrize(("share", "time"), [(0.3, 0.5), (0.8, 2.0)])
def test_a_jump_creeps_and_relaxes_as_one_term_does(share, time):
    # Standard linear solid: G(t) = 1 - g + g exp(-t / tau), J(t) = 1/(1-g) - g/(1-g) exp(-(1-g) t / tau).
    at = np.array([0.1, 0.7, 3.0])
    creep = 1 / (1 - share) - share / (1 - share) * np.exp(-(1 - share) * at / time)
    for under, exact in (("force", creep), ("depth", 1 - share + share * np.exp(-at / time))):
        memory = PadMemory(((share, time),), under, pads=2, values=1)
        jump = np.array([[1.0], [-3.0]])
        assert memory.step(jump, 0.0) == pytest.approx(jump)
        seen = [memory.step(jump, duration) for duration in np.diff(at, prepend=0.0)]
        np.testing.assert_allclose(np.array(seen)[:, :, 0], exact[:, None] * jump[:, 0], rtol=1e-12)


def test_a_ramp_with_two_terms_is_the_hereditary_integral():
    terms, rate, end = ((0.2, 0.05), (0.3, 1.5)), 4.0, 2.0
    memory = PadMemory("0.2 0.05; 0.3 1.5", "depth", 1, 1)
    steps = [0.3, 0.01, 0.69, 1.0]
    for time, step in zip(np.cumsum(steps), steps, strict=True):
        value = memory.step(np.array([[rate * time]]), step)
    integral = 0.5 * end + sum(weight * tau * -math.expm1(-end / tau) for weight, tau in terms)
    assert value[0, 0] == pytest.approx(rate * integral, rel=1e-12)


def test_creep_undoes_relaxation():
    terms = ((0.2, 0.05), (0.3, 1.5))
    creep, relaxation = (PadMemory(terms, under, 1, 1) for under in ("force", "depth"))
    rng, force = np.random.default_rng(1), []
    # A force that relaxes, applied to the creep: the depth it came from. Short steps, since neither is linear in them.
    depth = np.repeat(rng.normal(size=4).cumsum(), 4000)
    depth = np.convolve(depth, np.ones(800) / 800)[: len(depth)]
    force = [creep.step(relaxation.step(np.array([[x]]), 2e-4), 2e-4)[0, 0] for x in depth]
    np.testing.assert_allclose(force, depth, atol=1e-4 * np.abs(depth).max())


def test_reset_and_unknown_pads():
    memory = PadMemory(((0.5, 1.0),), "force", 3, 1)
    memory.step(np.ones((3, 1)), 0.0)
    memory.reset([0])
    seen = memory.step(np.array([[1.0], [np.nan], [1.0]]), 1.0)
    assert 1 < seen[0, 0] < seen[2, 0] and np.isnan(seen[1, 0])  # the first ramps from 0 again
    again = memory.step(np.ones((3, 1)), 1.0)
    assert np.isfinite(again).all()


@pytest.mark.parametrize("pads", [(0, 2), [0, 2], np.array([True, False, True])])
def test_pads_are_reset_by_any_kind_of_index(pads):
    memory = PadMemory("0.4 1", "depth", 3, 3)
    jump = np.ones((3, 3))
    memory.step(jump, 0.0)
    memory.step(jump, 1e3)
    memory.reset(pads)
    np.testing.assert_allclose(memory.step(jump, 0.0), [[1.0] * 3, [0.6] * 3, [1.0] * 3])
    imperfect = ImperfectPads(REST, 3, circuit=LINEAR, noise=False)
    for duration in (0.0, 1e3):
        imperfect.step(np.full((3, 2), 4e-3), duration)
    imperfect.reset(pads)
    at_rest = imperfect.step(np.tile(REST, (3, 1)), 0.0).voltage
    np.testing.assert_allclose(at_rest, np.where([[False], [True], [False]], 0.8, 200 * REST))


def test_a_pad_with_a_nan_keeps_its_memory():
    memory = PadMemory("0.4 1", "depth", 2, 1)
    memory.step(np.ones((2, 1)), 0.0)
    memory.step(np.array([[1.0], [np.nan]]), 10.0)
    np.testing.assert_allclose(memory.step(np.ones((2, 1)), 0.0), [[0.6 + 0.4 * math.exp(-10)], [1.0]])


def test_the_low_pass_has_the_step_response_of_first_order():
    pads = ImperfectPads(REST, 2, circuit=LINEAR, noise=False)
    before = 200 * REST
    power = np.stack([2 * REST, REST])
    np.testing.assert_allclose(pads.step(power, 0.0).voltage, np.tile(before, (2, 1)), rtol=1e-9)
    for time in np.cumsum([1e-3, 4e-3, 2e-3]):
        readings = pads.step(power, {1: 1e-3, 5: 4e-3, 7: 2e-3}[round(1e3 * time)])
        passed = 1 - math.exp(-2 * math.pi * 50 * time)
        np.testing.assert_allclose(readings.voltage, before * np.array([[1 + passed], [1]]), rtol=1e-9)
        np.testing.assert_array_equal(readings.counts, np.floor(readings.voltage / (5 / 4096)))
    quick = ImperfectPads(REST, 2, circuit=LINEAR, noise=False, latency=False)
    np.testing.assert_allclose(quick.step(power, 0.0).voltage, 200 * power, rtol=1e-9)


@pytest.mark.parametrize(("bandwidth", "duration"), [(50.0, 2e-3), (1000.0, 1e-4)])
def test_noise_has_the_variance_and_the_correlation_of_a_low_pass(bandwidth, duration):
    circuit = Circuit(
        supply=5.0,
        load_resistance=1000.0,
        transfer=0.2,
        saturation_voltage=0.0,
        bandwidth=bandwidth,
        current_gain=5e4,
        flicker_noise=2e-6,
        other_noise=3e-6,
    )
    count = 20000
    pads = ImperfectPads(REST, count, circuit=circuit, seed=3)
    power = np.tile(REST, (count, 1))
    first, second = (pads.step(power, duration).voltage - 200 * REST for _ in range(2))
    parts = noise_parts(circuit, REST)
    filtered = parts["shot"] ** 2 + parts["thermal"] ** 2
    variance = filtered + parts["flicker"] ** 2 + parts["other"] ** 2
    assert (filtered > 0.2 * variance).all()
    error = 4 * math.sqrt(2 / count)  # 4 standard errors of a variance
    np.testing.assert_allclose(first.var(axis=0), variance, rtol=error)
    shared = filtered * math.exp(-2 * math.pi * bandwidth * duration)
    np.testing.assert_allclose((first * second).mean(axis=0), shared, atol=error * variance.max())
    again = ImperfectPads(REST, count, circuit=circuit, seed=3)
    np.testing.assert_array_equal(again.step(power, duration).voltage - 200 * REST, first)


def test_spread_draws_whole_sensors_and_dead_taxels_are_dark():
    rng, count = np.random.default_rng(2), 3000
    spread = PadSpread(*(1 + 0.1 * rng.normal(size=(7, 2)) for _ in range(2)))
    pads = ImperfectPads(REST, count, spread=spread, dead=0.2, seed=4)
    change = np.array([1e-4, -3e-4])
    at_rest, loaded = (pads.step(np.tile(power, (count, 1)), 0.01).power for power in (REST, REST + change))
    assert abs(pads.dead.mean() - 0.2) < 4 * math.sqrt(0.16 / pads.dead.size)
    assert (loaded[pads.dead] == 0).all() and (loaded[~pads.dead] > 0).all()
    alive = ~pads.dead.any(axis=1)
    seen = np.concatenate([at_rest / REST, (loaded - at_rest) / change], axis=1)[alive]
    known = np.concatenate(spread, axis=1)
    distance = np.abs(seen[:, None] - known).max(axis=2)
    assert distance.min(axis=1).max() < 1e-9
    drawn = np.bincount(distance.argmin(axis=1), minlength=7)
    assert (np.abs(drawn - alive.sum() / 7) < 4 * math.sqrt(alive.sum() / 7)).all()


def test_all_is_off_by_default_and_memory_creeps():
    power = np.tile(1.1 * REST, (2, 1))
    readings = ImperfectPads(REST, 2).step(power, 0.1)
    assert readings.voltage is None and readings.counts is None
    np.testing.assert_allclose(readings.power, power)
    creeping = ImperfectPads(REST, 2, prony="0.5 1")
    creeping.step(power, 0.0)
    np.testing.assert_allclose(creeping.step(power, 1e3).power, 1.2 * np.tile(REST, (2, 1)))
    creeping.reset()
    np.testing.assert_allclose(creeping.step(np.tile(REST, (2, 1)), 0.1).power, np.tile(REST, (2, 1)))


def test_unknown_readings_are_flagged_and_leave_no_trace():
    pads, other = (ImperfectPads(REST, 2, circuit=LINEAR, prony="0.5 1", noise=False) for _ in range(2))
    power = np.tile(1.1 * REST, (2, 1))
    seen = pads.step(np.where([[True], [False]], power, np.nan), 1e-3)
    assert np.isnan(seen.power[1]).all() and np.isnan(seen.voltage[1]).all() and (seen.counts[1] == -1).all()
    expected = other.step(power, 1e-3)
    np.testing.assert_array_equal(seen.counts[0], expected.counts[0])
    after = pads.step(power, 1e-3)
    np.testing.assert_array_equal(after.voltage[1], expected.voltage[1])


def test_a_tolerance_study_is_read(tmp_path):
    nominal = {"rest": (2e-3, 5e-3), "sensitivity": (1e-4, -2e-4)}
    units = {"rest": "W", "sensitivity": "W/N"}
    rows = [
        {"figure": figure, "taxel": taxel, "unit": units[figure], "nominal": value}
        for figure, values in nominal.items()
        for taxel, value in enumerate(values, start=1)
    ]
    pandas.DataFrame(rows).to_csv(tmp_path / "spread.csv")
    with pytest.raises(InputError, match="samples.csv is missing"):
        read_spread(tmp_path)
    samples = {"exact": [True, True, False], "rest_1": [2.2e-3, 2e-3, np.nan], "rest_2": [5e-3, 4e-3, np.nan]}
    samples |= {"sensitivity_1": [1e-4, 0.9e-4, np.nan], "sensitivity_2": [-3e-4, -2e-4, np.nan]}
    pandas.DataFrame(samples).to_csv(tmp_path / "samples.csv")
    spread = read_spread(str(tmp_path))
    np.testing.assert_allclose(spread.rest, [[1.1, 1.0], [1.0, 0.8]])
    np.testing.assert_allclose(spread.change, [[1.0, 1.5], [0.9, 1.0]])
    for kept in ([row for row in rows if row["figure"] == "rest"], [{**row, "unit": "V"} for row in rows]):
        pandas.DataFrame(kept).to_csv(tmp_path / "spread.csv")
        with pytest.raises(InputError, match="a study over force, without a circuit, is needed"):
            read_spread(tmp_path)
    for kept, message in (
        ([{**row, "nominal": 1e-9} for row in rows], "nominal rest of taxel 1, 2 .* smaller than its spread"),
        ([{**row, "nominal": math.nan} for row in rows], "no exact sample with all readings"),
        ([{"a": 1}], "spread.csv or samples.csv cannot be read"),
    ):
        pandas.DataFrame(kept).to_csv(tmp_path / "spread.csv")
        with pytest.raises(InputError, match=message):
            read_spread(tmp_path)
    (tmp_path / "spread.csv").write_text("")
    with pytest.raises(InputError, match="cannot be read"):
        read_spread(tmp_path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"pads": 0}, "pads = 0 is not allowed"),
        ({"dead": 1.5}, "dead = 1.5 is not allowed: a probability"),
        ({"prony": "0.5"}, "prony = '0.5' is not allowed"),
        ({"spread": PadSpread(np.ones((3, 4)), np.ones((3, 4)))}, "spread with arrays (3, 4) and (3, 4)"),
        ({"spread": PadSpread(np.ones((3, 2)), np.ones((2, 2)))}, "spread with arrays (3, 2) and (2, 2)"),
        ({"spread": PadSpread(np.ones((0, 2)), np.ones((0, 2)))}, "spread with arrays (0, 2) and (0, 2)"),
        ({"seed": -1}, "seed = -1 is not allowed"),
        ({"circuit": 5.0}, "circuit = 5.0 is not allowed: a Circuit is needed"),
        ({"noise": 1}, "noise = 1 is not allowed"),
    ],
)
def test_bad_arguments_are_refused(arguments, message):
    with pytest.raises(InputError) as raised:
        ImperfectPads(REST, **{"pads": 2, **arguments})
    assert str(raised.value).startswith(message)


def test_bad_steps_are_refused():
    pads = ImperfectPads(REST, 2)
    for power, duration, message in (
        (np.ones((3, 2)), 0.1, r"power of shape \(3, 2\) is not allowed: an array \(2, 2\) is needed"),
        (np.ones((2, 2)), -0.1, "duration = -0.1 is not allowed: a number of at least 0 s is needed"),
        (np.ones((2, 2)), math.nan, "duration = nan is not allowed"),
    ):
        with pytest.raises(InputError, match=message):
            pads.step(power, duration)
