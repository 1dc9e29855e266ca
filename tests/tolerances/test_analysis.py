"""Few exact samples of a cell beside the study of all its samples."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pandas
import pytest
import xarray as xr
from one_cell import one_cell

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.tolerances import law_of, run_tolerance
from mitsuba_taxel.tolerances.analysis import (
    _note_of_saturation,
    _notes_of_few,
    _notes_of_indices,
    _of_figure,
    nominal_errors,
)
from mitsuba_taxel.tolerances.figures import figures

CELL = one_cell(scattering="isotropic", fz=0, led_power=1, spacing=0.8).replace(
    '<emitter type="annular_led">', '<float name="spacing" value="$spacing"/> <emitter type="annular_led">'
)
STUDY = """
scene = "cell.xml"
points = 64
[tolerance]
samples = 32
[tolerance.of]
led_power = { law = "normal", mean = 1, sd = 0.15 }
spacing = { law = "uniform", low = 0.67, high = 0.93 }
"""
EXACT = 8


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """The study of all samples, and that of few, with no further computation."""
    folder = tmp_path_factory.mktemp("few")
    (folder / "cell.xml").write_text(CELL)
    (folder / "study.toml").write_text(STUDY)
    whole = run_tolerance(folder / "study.toml", folder / "out")
    few = run_tolerance(folder / "study.toml", folder / "out", exact=EXACT)
    return whole, few, folder / "out"


def test_few_exact_samples_tell_what_all_do(both):
    """Within 5 of the stated errors: by Student, with 7 degrees of freedom, each is missed with probability 1.6e-3.
    Closer than the exact samples alone, and with little more than half the error of as many."""
    whole, few, _ = both
    (all_of_them,), (row,) = whole.spread.itertuples(), few.spread.itertuples()
    alone = whole.samples.rest_1[:EXACT]
    for name in ("mean", "sd", "low", "high"):
        error = getattr(row, f"{name}_error")
        assert abs(getattr(row, name) - getattr(all_of_them, name)) < 5 * error
    assert row.mean_error < 0.6 * all_of_them.sd / np.sqrt(EXACT) and row.linear_explained > 0.95
    assert abs(row.mean - all_of_them.mean) < abs(alone.mean() - all_of_them.mean)
    assert abs(row.sd - all_of_them.sd) < abs(alone.std() - all_of_them.sd)
    for name in ("nominal", "linear_sd"):
        assert getattr(row, name) == getattr(all_of_them, name)


def test_shares_of_few_are_those_of_all(both):
    whole, few, _ = both
    np.testing.assert_allclose(few.shares.total, whole.shares.total, atol=0.03)
    assert few.spread.explained[0] > 0.99 and few.notes[1:] == [LEFT_OUT["tolerance"]]


def test_the_table_of_samples_tells_which_are_exact(both):
    whole, few, folder = both
    samples = few.samples
    pandas.testing.assert_frame_equal(pandas.read_csv(folder / "samples.csv"), samples)
    assert list(samples) == ["led_power", "spacing", "exact", "rest_1", "linear_rest_1"]
    assert list(np.flatnonzero(samples.exact)) == list(range(EXACT))
    np.testing.assert_array_equal(samples.rest_1[:EXACT], whole.samples.rest_1[:EXACT])
    assert samples.rest_1[EXACT:].isna().all()
    missed = samples.linear_rest_1 - whole.samples.rest_1
    assert np.sqrt(np.mean(missed**2)) == pytest.approx(whole.spread.linear_error[0] * whole.spread.sd[0], rel=0.05)


def test_the_reader_is_told_what_few_samples_cannot_tell():
    spread = pandas.DataFrame(
        {"figure": ["rest", "rest", "sensitivity"], "taxel": [1, 2, 1], "linear_explained": [0.4, 0.3, 0.99]}
    )
    shares = pandas.DataFrame({"parameter": list("abcde"), "rate": 1.0})
    (note,) = _notes_of_few(spread, shares, exact=9, linear=91, parameters=5)
    assert "explains only 30% of the variance of rest (taxel 2)" in note and "91 samples add little" in note
    (note,) = _notes_of_few(spread[2:], shares, exact=8, linear=92, parameters=5)
    assert "Sobol' indices are shares of the linear estimate" in note and "exact = 9 or more" in note


def test_the_reader_is_told_which_parameters_the_linear_answer_leaves_out():
    spread = pandas.DataFrame({"figure": ["rest"], "taxel": [1], "linear_explained": [0.0]})
    shares = pandas.DataFrame({"parameter": ["a", "b"], "rate": [1.0, math.nan]})
    (note,) = _notes_of_few(spread, shares, exact=9, linear=91, parameters=2)
    assert note.startswith("the linear estimate, which leaves out b, explains only 0% of the variance of rest")
    (note,) = _notes_of_few(spread, shares.assign(rate=math.nan), exact=9, linear=91, parameters=2)
    assert note.startswith("no parameter has a linear estimate: results come from the 9 exact samples alone")


@pytest.mark.parametrize(
    ("linear", "remedy"),
    [(0, "samples = 32 or more"), (1, "samples = 32 and exact = 20 or more"), (100, "exact = 20 or more")],
)
def test_the_reader_is_told_what_would_give_indices(linear, remedy):
    """A polynomial of third degree in three parameters has 20 terms; a Sobol' sequence needs a power of 2."""
    spread = pandas.DataFrame({"figure": ["rest"], "taxel": [1], "sd": [1.0], "explained": [-0.14]})
    shares = pandas.DataFrame({"figure": "rest", "taxel": 1, "total": [math.nan] * 3})
    (note,) = _notes_of_indices(spread, shares, exact=16, linear=linear, parameters=3)
    assert f"the polynomial explains 0% of the variance, 80% are needed; {remedy}, to which" in note


def test_the_reader_is_told_how_many_samples_saturate():
    found = np.array([[np.nan, -1.0], [np.nan, -2.0], [-0.5, np.nan]])
    (note,) = _note_of_saturation({"saturation_force": found}, np.array([-3.0, 0.0]))
    assert note == "the output reaches the circuit's limit between 0 and -3 N in 2 of 3 samples (taxel 2)"
    assert _note_of_saturation({"rest": found}, np.zeros(1)) == []


def test_the_relative_error_of_what_does_not_vary_is_missing():
    """Such as the cross-talk of taxels that a symmetry makes equal."""
    plan = SimpleNamespace(laws=[law_of("a", {"law": "normal", "mean": 1, "sd": 0.1})], batch=SimpleNamespace(seed=0))
    z = np.random.default_rng(1).normal(size=(16, 1))
    slopes, at_mean = np.array([[0.0], [2.0]]), np.array([3.0, 1.0])
    (still, moved), _ = _of_figure(plan, "rest", at_mean, at_mean + 0.1 * z * [0, 2], slopes, z, z[:0])
    assert math.isnan(still["linear_error"]) and moved["linear_error"] == pytest.approx(0, abs=1e-12)


CASES, OTHERS = 15, 8
LOADS = np.linspace(0.0, -2.0, 4)


def sensors_of_many_taxels(seed, own):
    """Of each: readings in error with stated errors, and right ones, of a loaded taxel and others that change less.

    The error is as large as stated, times a smooth random course; a share ``own`` of its variance is each taxel's own.
    """
    random, x = np.random.default_rng(seed), LOADS / LOADS[-1]
    kernel = np.exp(-((LOADS[:, None] - LOADS) ** 2) / (2 * LOADS[-1] ** 2))
    change = 0.3 * np.array([1.0, *random.uniform(-0.5, 1.0, OTHERS)])
    true = 1e-3 * (1 + change * x[:, None])[None]
    common, alone = (random.multivariate_normal(0 * LOADS, kernel, n, method="eigh").T for n in (1, OTHERS + 1))
    size = 0.003 * x[:, None]
    read = true * (1 + size * (np.sqrt(1 - own) * common + np.sqrt(own) * alone))
    dims = ["step", "fz", "taxel"]
    coords, about = {"fz": LOADS, "taxel": np.arange(1, OTHERS + 2)}, {"curve": "fz"}
    studies = []
    for power in (read, true):
        replicates = np.repeat(power[..., None], 2, axis=-1)
        variables = {
            "replicate_power": ([*dims, "replicate"], replicates),
            "deviation": (dims, size * power / ERROR_SHARE),
        }
        studies.append(xr.Dataset(variables, coords, about))
    return studies


@pytest.mark.parametrize("own", [0.0, 1.0])
def test_errors_of_the_mean_sensor_hold_whatever_taxels_have_in_common(own):
    """Of cross-talks of 15 sensors with eight other taxels each: as many are within twice the stated error as of normal
    ones, but for the 3 points allowed and 3 standard errors of the count of sensors; stated errors are at most 5 times
    the true ones in the median."""
    plan, ratio = SimpleNamespace(force="fz", batch=SimpleNamespace(circuit=None)), []
    for seed in range(CASES):
        read, true = sensors_of_many_taxels(seed, own)
        values = [figures(one.replicate_power.values[0, ..., 0], LOADS, 0)["crosstalk"] for one in (read, true)]
        ratio.append(((values[0] - values[1]) / nominal_errors(plan, read, LOADS, 0)["crosstalk"])[1:])
    ratio = np.abs(ratio)
    assert (ratio <= 2).mean() > 0.9545 - 0.03 - 3 * np.sqrt(0.0455 * 0.9545 / CASES)
    assert 1 < np.median(1 / ratio) < 5


def test_errors_of_the_mean_sensor_have_a_closed_form():
    """A sensitivity of readings that are off by c of their power at the last load is off by c of it over the force; the
    reading at rest, without an error, is exact; and nothing is known of the loaded taxel's cross-talk with itself."""
    plan, (_, true) = SimpleNamespace(force="fz", batch=SimpleNamespace(circuit=None)), sensors_of_many_taxels(0, 0.0)
    errors, last = nominal_errors(plan, true, LOADS, 0), true.replicate_power.values[0, -1, :, 0]
    np.testing.assert_allclose(errors["sensitivity"], 0.003 * last / 2, rtol=5e-3)
    assert not errors["rest"].any() and math.isnan(errors["crosstalk"][0])


def test_errors_of_the_mean_sensor_do_not_ask_what_the_force_is_called():
    _, read = sensors_of_many_taxels(0, 0.0)
    other = read.rename(fz="f").assign_attrs(forces='{"f": ["fz", 1]}')
    one, renamed = (
        nominal_errors(SimpleNamespace(force=name, batch=SimpleNamespace(circuit=None)), study, LOADS, 0)
        for name, study in (("fz", read), ("f", other))
    )
    for name, errors in one.items():
        np.testing.assert_allclose(renamed[name], errors, rtol=1e-12)
