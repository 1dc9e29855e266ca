"""Slopes in few rows: what stands for an array, relative slopes, and what is said in place of numbers."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.characterise import Branch, Experiment, characteristics, sensitivity_table, slope_summary
from mitsuba_taxel.characterise.experiment import Tangents

FORCE = np.array([0.0, -5, -10])


def experiment(samples, **more):
    taxel = np.arange(1, samples.shape[2] + 1)
    return Experiment("fz", np.array([0, 0, 1.0]), {}, "W", taxel, (Branch(FORCE, samples),), **more)


def test_what_is_below_its_error_is_not_resolved():
    """Two replicates, each +-1 about 0 and about 10; a magnitude below 0 is not resolved either."""
    noise = np.array([-1.0, 1])[:, None] * np.array([0, 1, 1.0])[:, None, None]
    samples = noise + np.array([0, 10.0]) * FORCE[:, None, None]
    table = characteristics([experiment(samples)]).set_index(["figure", "taxel"]).remark
    assert table["mean_slope", 1] == "not resolved" and table["mean_slope", 2] == ""
    assert table["nonlinearity", 2] == "not resolved"


def test_a_largest_slope_below_the_mean_one_is_told():
    """Straight lines with noise: the estimate of the largest slope is below the mean one in nearly every other."""
    rng = np.random.default_rng(0)
    samples = -4.0 * FORCE[:, None, None] + rng.normal(size=(3, 32, 60))
    table = characteristics([experiment(samples)])
    largest, mean = (table[table.figure == name].reset_index() for name in ("max_slope", "mean_slope"))
    below = np.abs(largest.value) < np.abs(mean.value)
    assert 10 < below.sum() < 50 and list(largest.remark == "as the mean") == list(below) and not any(mean.remark)


def test_relative_slope_is_free_of_noise_that_readings_share():
    """Each replicate sees other gains, which change readings at rest and slopes alike: -1 %/N without an error."""
    gains = np.random.default_rng(1).normal(1, 0.1, (32, 1))
    power = gains * 2e-3 * (1 - 0.01 * FORCE[:, None, None])
    study = xr.Dataset({"replicate_power": (["fz", "replicate", "taxel"], power)}, coords={"fz": FORCE, "taxel": [1]})
    row = sensitivity_table(study).iloc[0]
    assert row.relative_slope_percent_per_N == pytest.approx(-1) and row.relative_slope_error_percent_per_N < 1e-12
    assert row.mean_slope_error_W_per_N > 1e-7
    assert slope_summary(study)[1].set_index("figure").value["relative_slope"] == pytest.approx(-1)


@pytest.mark.parametrize(("taxels", "words"), [(1, ""), (2, "mean of 2 taxels")])
def test_curves_of_one_taxel_keep_its_number(taxels, words):
    power = 2e-3 * (1 - 0.01 * FORCE[:, None, None, None]) + np.zeros((3, 2, 32, taxels))
    dims = ["fz", "spacing", "replicate", "taxel"]
    coords = {"fz": FORCE, "spacing": [0.7, 0.9], "taxel": np.arange(1, taxels + 1)}
    said, table = slope_summary(xr.Dataset({"replicate_power": (dims, power)}, coords))
    assert said == words and len(table) == 2 * len(set(table.figure))
    assert ("taxel" in table) == (taxels == 1) and set(table.get("taxel", [1])) == {1}


def test_tangents_of_a_sum():
    slope = np.array([[1.0, 3.0]] * 3)
    run = Branch(FORCE, np.zeros((3, 4, 2)), Tangents(0 * slope, slope, slope / 10))
    one = Experiment("fz", np.array([0, 0, 1.0]), {}, "W", np.arange(2), (run,), rest=np.ones((4, 2)))
    mean = one.weighted(np.array([0.5, -0.5]))
    assert mean.runs[0].tangents is not None and mean.rest is not None and len(mean.taxel) == 1
    np.testing.assert_allclose(mean.runs[0].tangents.slope, -1)
    np.testing.assert_allclose(mean.runs[0].tangents.error, 0.2)
    np.testing.assert_allclose(mean.rest, 0)


def test_several_curves_have_a_row_each():
    power = 2e-3 * (1 - 0.01 * np.array([1, 2.0])[:, None, None, None] * FORCE[:, None, None]) * np.ones((2, 3, 4, 9))
    study = xr.Dataset(
        {"replicate_power": (["cell", "fz", "replicate", "taxel"], power)},
        coords={"cell": ["a", "b"], "fz": FORCE, "taxel": np.arange(1, 10)},
    )
    words, table = slope_summary(study)
    assert words == "mean of 9 taxels" and "taxel" not in table
    relative = table[table.figure == "relative_slope"]
    assert list(relative.cell) == ["a", "b"] and list(relative.value) == pytest.approx([-1, -2])
