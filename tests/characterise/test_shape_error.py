"""Errors of figures by those of the pads' shape: counted on made-up courses of the error along a path."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.characterise import characteristics, compare, simulated_experiments
from mitsuba_taxel.characterise.shape_error import COURSE

CASES = 300
LOADS = np.linspace(0.0, -2.0, 5)


def study_of(power, deviation, **parameters):
    """Readings (cases, loads) in W without noise, and their deviation."""
    dims, coords = ["case", "fz", "replicate", "taxel"], {"case": np.arange(len(power), dtype=float), "fz": LOADS}
    variables = {
        "replicate_power": (dims, np.repeat(power[:, :, None, None], 2, axis=2)),
        "deviation": (["case", "fz", "taxel"], deviation[:, :, None]),
    }
    return xr.Dataset(variables, {**coords, "taxel": [1]}, {"curve": "fz", "seed": 0, "points": 64})


def made_up(seed=0):
    """Readings in error, stated and true ones.

    The true error is a share of the change from rest that changes along the path by a tenth of its size, straight or
    bent; two meshes tell its size at the last load but for a factor. In every third case their difference has another
    sign in the upper half of the loads, and the share changes as much as its size.
    """
    random, x = np.random.default_rng(seed), LOADS / LOADS[-1]
    true = (1 + 0.25 * x - 0.06 * x**2) * np.ones((CASES, 1))
    size = 10 ** random.uniform(-3.5, -2.2, (CASES, 1))
    turns = np.arange(CASES)[:, None] % 3 == 0
    course = random.normal(size=(CASES, 2)) @ np.stack([x - 0.5, 1.5 * (x - 0.5) ** 2])
    error = size * x * (np.where(turns, 0.3, 1.0) * random.normal(size=(CASES, 1)) + np.where(turns, 0.8, 0.1) * course)
    stated = size * np.exp(0.2 * random.normal(size=(CASES, 1))) * x
    stated *= np.where(turns & (np.arange(len(x)) >= random.integers(3, len(x), (CASES, 1))), -1, 1)
    power = true * (1 + error)
    return study_of(power, stated * power / ERROR_SHARE), study_of(true, 0 * true)


def by_figure(study):
    found = simulated_experiments(study)
    return characteristics(found.experiments, found.off).set_index(["figure", "case"])[["value", "error"]]


@pytest.fixture(scope="module")
def counted():
    return [by_figure(study) for study in made_up()]


@pytest.mark.parametrize("figure", ["mean_slope", "relative_slope", "max_slope", "zero_slope", "nonlinearity"])
def test_stated_errors_hold_whatever_the_course_of_the_error(figure, counted):
    """Within twice the stated error are at most 3 points less than the 95.45 % of normal errors, and the median of
    stated over true is at most 5, whether the meshes tell a common share or not."""
    stated, true = (table.loc[figure] for table in counted)
    off = np.abs(stated.value - true.value)
    turns = stated.index.to_numpy() % 3 == 0
    for which in (turns, ~turns):
        assert (off <= 2 * stated.error)[which].mean() > 0.9545 - 0.03
        assert 1 < np.median((stated.error / off)[which]) < 5


def test_a_common_share_changes_no_nonlinearity_but_by_its_random_course():
    """Readings off by one share of their change keep their nonlinearity: what is stated is a tenth of the effect of a
    course that is not known at all, as where the deviation changes its sign."""
    x, c = LOADS / LOADS[-1], 0.01
    power = (1 + 0.2 * x - 0.05 * x**2)[None]
    deviation = c * (power - power[:, :1]) / ERROR_SHARE
    common = by_figure(study_of(power, deviation)).error["nonlinearity"].item()
    turned = by_figure(study_of(power, deviation * np.array([1, 1, 1, -1, -1]))).error["nonlinearity"].item()
    assert common / turned == pytest.approx(COURSE, rel=0.2)
    assert turned > 5 * common


def test_differences_of_variants_have_errors_that_hold():
    """Of two dimensions whose errors share eight ninths of their variance, and are stated to be of the same size: 85 %
    within twice the stated error fail in one of 400 samples of 30."""
    random, x = np.random.default_rng(1), LOADS / LOADS[-1]
    within, ratio = [], []
    for _ in range(30):
        error = 1e-3 * (random.normal() + np.sqrt(0.5) * 0.5 * random.normal(size=2))[:, None] * x
        true = 1 + np.array([[0.25], [0.26]]) * x
        study = study_of(true * (1 + error), 1e-3 * x * np.ones((2, 1)) / ERROR_SHARE)
        table = compare({"one": study}, "mean_slope").table.sort_values("case")
        behind = table.mean_slope.to_numpy() @ [1, -1]
        off, stated = abs(behind - 0.005), table.behind_error.max()
        within.append(off <= 2 * stated)
        ratio.append(stated / off)
    assert np.mean(within) > 0.85 and 1 < np.median(ratio) < 5


def test_errors_of_a_straight_curve_have_a_closed_form():
    """If readings are off by the share c of their change, the mean slope is off by c of itself; the nonlinearity at the
    middle by the random course, c (g(F/2) - g(F)) / 2, whose variance the correlation of these gives."""
    x, c = LOADS / LOADS[-1], 0.01
    power = (1 + 0.2 * x)[None]
    found = by_figure(study_of(power, c * 0.2 * x[None] / ERROR_SHARE))
    assert found.error["mean_slope"].item() == pytest.approx(c * 0.1, rel=5e-3)
    middle = 100 * COURSE * c * np.sqrt(2 * (1 - np.exp(-1 / 8))) / 2
    assert found.error["nonlinearity"].item() == pytest.approx(middle, rel=5e-2)


def test_the_larger_of_two_estimates_of_one_error_is_stated():
    """That of the derivatives, and that of the readings, whose derivative by the force is exact for a straight course:
    of slopes and of a nonlinearity."""
    x, c = LOADS / LOADS[-1], 0.01
    power = (1 + 0.2 * x)[None]
    alone = study_of(power, c * 0.2 * x[None] / ERROR_SHARE)
    for least in (1e-4, 0.03):
        study = alone.assign(
            smooth_power=(["case", "fz", "taxel"], power[..., None]),
            derivative=(["case", "fz", "taxel", "parameter"], np.full((1, 5, 1, 1), -0.1)),
            derivative_error=(["case", "fz", "taxel", "parameter"], np.full((1, 5, 1, 1), 0.1 * least)),
        )
        found, larger = by_figure(study.assign_coords(parameter=["fz"])), max(least / c, 1.0)
        for figure in ("mean_slope", "max_slope", "zero_slope"):
            assert found.error[figure].item() == pytest.approx(0.1 * c * larger, rel=0.06)
            assert found.value[figure].item() == pytest.approx(-0.1)
        expected = larger * by_figure(alone).error["nonlinearity"].item()
        assert found.error["nonlinearity"].item() == pytest.approx(expected, rel=5e-3)


def test_the_random_course_grows_with_the_strain():
    """Of 0.06, it is 5 x 0.06 = 0.3 of the error, three times as large as at small strains."""
    x = LOADS / LOADS[-1]
    study = study_of((1 + 0.2 * x)[None], 0.002 * x[None] / ERROR_SHARE)
    small, large = (
        by_figure(study.assign(largest_strain=(["case", "fz"], most * x[None]))).error for most in (0.01, 0.06)
    )
    assert large["nonlinearity"].item() == pytest.approx(3 * small["nonlinearity"].item(), rel=1e-2)
    assert large["mean_slope"].item() == pytest.approx(small["mean_slope"].item(), rel=5e-3)


def test_errors_of_diagonal_loads_change_slopes_along_the_load():
    """Of a path on which two forces change together, the slope along the resultant is off by the share of the error."""
    x, c = LOADS / LOADS[-1], 0.01
    dims, power = ["step", "taxel"], (1 + 0.2 * x)[:, None]
    slope = 0.2 / np.hypot(3.0, 4.0)
    study = xr.Dataset(
        {
            "replicate_power": (["step", "replicate", "taxel"], np.repeat(power[:, None], 2, axis=1)),
            "deviation": (dims, c * 0.2 * x[:, None] / ERROR_SHARE),
            "smooth_power": (dims, power),
            "derivative": ([*dims, "parameter"], np.full((5, 1, 2), slope) * [0.6, -0.8]),
            "derivative_error": ([*dims, "parameter"], np.zeros((5, 1, 2))),
        },
        {
            "fx": ("step", 3.0 * x), "fz": ("step", -4.0 * x), "step": np.arange(5), "taxel": [1],
            "parameter": ["fx", "fz"],
        },
        {"curve": "step", "seed": 0, "points": 64},
    )  # fmt: skip
    found = simulated_experiments(study)
    table = characteristics(found.experiments, found.off).set_index("figure")
    for figure in ("mean_slope", "max_slope", "zero_slope"):
        assert table.value[figure] == pytest.approx(slope)
        assert table.error[figure] == pytest.approx(c * slope, rel=0.06)
