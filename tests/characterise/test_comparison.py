"""Rankings of variants: the probability of the first, limits, and what drops out of paired differences."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import InputError
from mitsuba_taxel.characterise import compare, comparison_rows

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
    headings, rows = comparison_rows(found)
    assert headings == ["rank", "cell", "mean slope [mW/N]", "nonlinearity [%]", "allowed", "first", "behind [mW/N]"]
    assert rows[0][-3:] == ["100%", "100.0%", "-"] and rows[0][3] == "not resolved"
    assert compare({"one": both}, "nonlinearity").table.cell[0] == "b"


@pytest.mark.parametrize("variants, shared", [([1.0, 2.0], True), (["a", "b"], False)])
def test_what_mechanics_does_to_dimensions_drops_out_and_to_shapes_does_not(variants, shared):
    one = study([0.02, 0.01], 1e-9).assign_coords(cell=variants)
    moved = one.assign(deviation=(("fz", "taxel"), -1e-3 * FORCE[:, None])).broadcast_like(one)
    table = compare({"one": moved}, "mean_slope").table
    assert table.mean_slope_error.min() > 1e-4
    assert table.behind_error[1] == pytest.approx(0 if shared else np.hypot(*table.mean_slope_error), abs=1e-8)


def test_forces_that_are_not_reached():
    one = study([0.02, 0.01], 1e-6)
    short = one.isel(fz=slice(0, 2)).assign_attrs(seed=7)
    found = compare({"long": one, "short": short}, "mean_slope", up_to=10)
    assert len(found.table) == 2 and len(found.notes) == 2 and "ends at 5 N: study = short" in found.notes[0]
    assert len(compare({"long": one, "short": short}, "mean_slope", up_to=5).table) == 4


@pytest.mark.parametrize(
    "vary, how, complaint",
    [
        ({}, {"by": "beauty"}, "figure 'beauty' is not known"),
        ({}, {"force": "fx"}, "force = 'fx' is not varied: one of fz"),
        ({"cell": [0]}, {}, "1 variants along a force are not enough"),
        ({}, {"by": "hysteresis"}, "hysteresis is not known of every variant: growing and falling forces"),
        ({"fz": [0, 1]}, {"by": "nonlinearity"}, "three forces are needed"),
    ],
)
def test_what_cannot_be_compared(vary, how, complaint):
    with pytest.raises(InputError, match=complaint):
        compare({"one": study([1.0, 2.0], 1e-3).isel(vary)}, **how)
