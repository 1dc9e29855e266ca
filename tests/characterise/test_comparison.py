"""Rankings of variants: the probability of the first, limits, and what drops out of paired differences."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import Circuit, InputError
from mitsuba_taxel.characterise import compare

FORCE = np.array([0.0, -5, -10])


def study(slopes, noise, shared=1.0, bend=0.0, seed=0, **attrs):
    """Variants of a sensor that reads 1 W at rest; noise on slopes, of which variants share a part."""
    rng = np.random.default_rng(seed)
    common, own = rng.normal(size=(1, 1, 32, 1)), rng.normal(size=(len(slopes), 1, 32, 1))
    each = np.array(slopes)[:, None, None, None] + noise * (shared * common + np.sqrt(1 - shared**2) * own)
    line = FORCE[:, None, None]
    power = 1 - each * line * (1 + bend * (line + 10)) * np.ones((1, 3, 32, 1))
    coords = {"cell": list("abcd")[: len(slopes)], "fz": FORCE, "taxel": [1]}
    attrs = {"seed": seed, "points": 64, "curve": "fz", **attrs}
    return xr.Dataset({"replicate_power": (["cell", "fz", "replicate", "taxel"], power)}, coords, attrs)


def test_noise_that_variants_share_drops_out_of_their_difference():
    table = compare({"one": study([0.010, 0.0101], 1e-3)}, "mean_slope").table
    assert list(table.cell) == ["b", "a"] and list(table["first"]) == [1, 0]
    assert table.mean_slope_error[0] > 1e-4 and table.behind_error[1] < 1e-9
    assert table.behind[1] == pytest.approx(1e-4)
    apart = {name: study([0.010, 0.0101], 1e-3, seed=seed).isel(cell=[seed]) for seed, name in enumerate("xy")}
    table = compare(apart, "mean_slope").table
    assert table.behind_error[1] == pytest.approx(np.hypot(*table.mean_slope_error), rel=1e-6)


def test_errors_of_differences_are_the_true_ones():
    """25 pairs that share half of their noise: normalised differences have variance 31/29, within 5 sigma."""
    z = []
    for seed in range(25):
        row = compare({"one": study([0.02, 0.01], 1e-4, shared=np.sqrt(0.5), seed=seed)}, "mean_slope").table.loc[1]
        z.append((row.behind - 0.01) / row.behind_error)
    assert abs(np.mean(z)) < 5 / np.sqrt(25) and abs(np.var(z) - 31 / 29) < 5 * np.sqrt(2 / 25)


def test_alike_variants_are_first_as_often_as_each_other():
    table = compare({"one": study([0.01, 0.01, 0.001], 1e-4, shared=0.0)}, "mean_slope").table
    assert table["first"].sum() == pytest.approx(1) and table["first"][2] == 0 and table["first"][1] > 0.001


def test_limits_come_before_the_figure():
    """The most sensitive one is bent by 12.5 % and not allowed."""
    bent = study([0.02, 0.01], 1e-6, bend=0.05).isel(cell=[0])
    straight = study([0.02, 0.01], 1e-6).isel(cell=[1])
    both = xr.concat([bent, straight], "cell")
    found = compare({"one": both}, "mean_slope", {"nonlinearity": 3})
    assert list(found.table.cell) == ["b", "a"] and list(found.table.allowed) == [1, 0]
    assert list(found.table["first"]) == [1, 0]
    assert compare({"one": both}, "nonlinearity").table.cell[0] == "b"


@pytest.mark.parametrize("variants, correlation", [([1.0, 2.0], math.exp(-1 / 8)), (["a", "b"], 0.0)])
def test_most_of_what_mechanics_does_to_dimensions_drops_out_and_to_shapes_does_not(variants, correlation):
    """Of equal errors of both, sqrt(2 (1 - correlation)) is left in the difference."""
    one = study([0.02, 0.01], 1e-9).assign_coords(cell=variants)
    moved = one.assign(deviation=(("fz", "taxel"), -1e-3 * FORCE[:, None])).broadcast_like(one)
    table = compare({"one": moved}, "mean_slope").table
    error = table.mean_slope_error[0]
    assert error > 1e-4 and table.mean_slope_error[1] == pytest.approx(error, rel=1e-2)
    assert table.behind_error[1] == pytest.approx(math.sqrt(2 * (1 - correlation)) * error, rel=1e-2)


def test_forces_that_are_not_reached():
    one = study([0.02, 0.01], 1e-6)
    short = one.isel(fz=slice(0, 2)).assign_attrs(seed=7)
    found = compare({"long": one, "short": short}, "mean_slope", up_to=10)
    assert len(found.table) == 2 and len(found.notes) == 2 and "ends at 5 N: study = short" in found.notes[0]
    assert len(compare({"long": one, "short": short}, "mean_slope", up_to=5).table) == 4


CIRCUIT = Circuit(supply=3.3, load_resistance=1.0, transfer=1.0, saturation_voltage=0.0, adc_bits=4)
"""1 V per watt, up to 3.3 V."""


def test_behind_a_linear_circuit_watts_are_volts():
    """Half a volt per watt; limits of slopes are in V/N."""
    one = {"one": study([0.02, 0.01], 1e-5, bend=0.01)}
    half = dataclasses.replace(CIRCUIT, load_resistance=0.5)
    watts = compare(one, "mean_slope", {"nonlinearity": 3})
    volts = compare(one, "mean_slope", {"nonlinearity": 3}, circuit=half)
    assert watts.volts is None and watts.unit["mean_slope"] == "W/N" and volts.unit["mean_slope"] == "V/N"
    for name in ("mean_slope", "mean_slope_error", "behind", "behind_error"):
        np.testing.assert_allclose(volts.table[name], watts.table[name] / 2, rtol=1e-9, atol=1e-18)
    for name in ("nonlinearity", "nonlinearity_error", "first", "allowed"):
        np.testing.assert_allclose(volts.table[name], watts.table[name], rtol=1e-6)
    limited = [list(compare(one, "mean_slope", {"mean_slope": 0.0075}, circuit=each).table.allowed) for each in
               (CIRCUIT, half)]  # fmt: skip
    assert limited == [[0, 0], [1, 0]]


def test_a_variant_that_saturates_is_not_ranked_in_volts():
    """More sensitive in watts, but at 3.3 V from 2.3 W and 0.1 N on."""
    bright = study([23.0, 0.01], 1e-6)
    first, second = (compare({"one": bright}, "mean_slope", circuit=each) for each in (None, CIRCUIT))
    assert list(first.table.cell) == ["a", "b"] and list(second.table.cell) == ["b"]
    left_out, steps = second.notes
    assert left_out == "Left out, as its output is saturated from 0.1 N on: cell = a."
    assert steps.startswith("The noise before the converter is less than half of its step of 0.2062 V")
    noisy = dataclasses.replace(CIRCUIT, other_noise=0.2)
    assert compare({"one": bright}, "mean_slope", circuit=noisy).notes == [left_out]
    assert len(compare({"one": bright}, "mean_slope", circuit=CIRCUIT, up_to=10).table) == 1
    with pytest.raises(InputError, match=r"all 2 are saturated \(study = x.* from 0.1 N on; study = y.* on\): less"):
        compare(dict.fromkeys("xy", bright.isel(cell=[0])), "mean_slope", circuit=CIRCUIT)
    told = second.volts.set_index("cell")
    assert told.saturation_N["a"] == pytest.approx(-0.1, rel=1e-3) and np.isnan(told.saturation_N["b"])
    assert told.mean_slope_counts_per_N["b"] == pytest.approx(-0.01 * 16 / 3.3, rel=1e-3)
    dazzled = bright.assign(replicate_power=bright.replicate_power + 3 * (bright.cell == "a"))
    assert list(compare({"one": dazzled}, "mean_slope").table.cell) == ["a", "b"]
    found = compare({"one": dazzled}, "mean_slope", circuit=CIRCUIT)
    assert list(found.table.cell) == ["b"] and "saturated at rest: cell = a" in found.notes[0]
    assert found.volts.set_index("cell").saturation_N["a"] == 0


def test_errors_by_the_shape_go_through_the_circuit():
    one = study([0.02, 0.01], 1e-9)
    moved = one.assign(deviation=(("fz", "taxel"), -1e-3 * FORCE[:, None])).broadcast_like(one)
    watts, volts = (compare({"one": moved}, "mean_slope", circuit=each).table for each in (None, CIRCUIT))
    np.testing.assert_allclose(volts.mean_slope_error, watts.mean_slope_error, rtol=1e-6)


def test_studies_have_their_own_circuits():
    """Or none of them has; a circuit that is given counts for all."""
    circuits = [dataclasses.replace(CIRCUIT, load_resistance=ohm) for ohm in (1.0, 0.25)]
    plain = study([0.02], 1e-6)
    own = [plain.assign_attrs(circuit=json.dumps(one.as_table())) for one in circuits]
    found = compare({"x": own[0], "y": own[1]}, "mean_slope")
    np.testing.assert_allclose(found.table.mean_slope, [-0.02, -0.005], rtol=1e-3)
    assert list(found.volts.study) == ["x", "y"] and list(found.volts)[:2] == ["force", "study"]
    with pytest.raises(InputError, match="^x in volts and z in watts cannot be compared: give a circuit for all"):
        compare({"x": own[0], "z": plain})
    both = compare({"x": own[0], "z": plain}, "mean_slope", up_to=5, circuit=circuits[1])
    np.testing.assert_allclose(both.table.mean_slope, -0.005, rtol=1e-3)
    assert compare({"x": own[0], "z": plain}, force="fz", circuit=circuits[1]).unit["relative_slope"] == "%/N"


@pytest.mark.parametrize(
    "vary, how, complaint",
    [
        ({}, {"by": "beauty"}, "figure 'beauty' is not known"),
        ({}, {"force": "fx"}, "force = 'fx' is not varied: one of fz"),
        ({"cell": [0]}, {}, "at least two variants along a force, and the studies hold 1;"),
        ({}, {"by": "hysteresis"}, "hysteresis is unknown for some variants: growing and falling forces"),
        ({"fz": [0, 1]}, {"by": "nonlinearity"}, "three forces are needed"),
    ],
)
def test_what_cannot_be_compared(vary, how, complaint):
    with pytest.raises(InputError, match=complaint):
        compare({"one": study([1.0, 2.0], 1e-3).isel(vary)}, **how)
