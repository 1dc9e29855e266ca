"""Errors of figures by those of the pads' shape: counted on made-up courses of the error along a path."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.characterise import characteristics, compare, simulated_experiments

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

    The true error grows from 0 at rest, straight, bent or with an inflection; two meshes tell its size at the last load
    but for a factor, and a straight course, in every third case with another sign from a random load on.
    """
    random, x = np.random.default_rng(seed), LOADS / LOADS[-1]
    true = (1 + 0.25 * x - 0.06 * x**2) * np.ones((CASES, 1))
    size = 10 ** random.uniform(-3.5, -2.2, (CASES, 1))
    error = size * random.normal(size=(CASES, 3)) @ (np.array([0.9, 0.4, 0.2])[:, None] * x ** np.arange(1, 4)[:, None])
    stated = size * np.exp(0.2 * random.normal(size=(CASES, 1))) * x
    stated[::3] *= np.where(np.arange(len(x)) < random.integers(1, len(x), (len(stated[::3]), 1)), 1, -1)
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
    stated over true is at most 5. The straight course of two meshes tells nothing of a nonlinearity."""
    stated, true = (table.loc[figure] for table in counted)
    off = np.abs(stated.value - true.value)
    assert (off <= 2 * stated.error).mean() > 0.9545 - 0.03
    assert 1 < np.median(stated.error / off) < 5


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
    """If readings are off by the share c of their change, the mean slope is off by c of itself, and the nonlinearity at
    the middle by c (g(F/2) - g(F)) / 2, whose variance the correlation of these gives."""
    x, c = LOADS / LOADS[-1], 0.01
    power = (1 + 0.2 * x)[None]
    found = by_figure(study_of(power, c * 0.2 * x[None] / ERROR_SHARE))
    assert found.error["mean_slope"].item() == pytest.approx(c * 0.1, rel=5e-3)
    middle = 100 * c * np.sqrt(2 * (1 - np.exp(-1 / 8))) / 2
    assert found.error["nonlinearity"].item() == pytest.approx(middle, rel=5e-2)
