"""Coverage of `compare`: probabilities and differences for synthetic variants of a sensor with known figures of
merit."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.characterise import characteristics, compare
from mitsuba_taxel.characterise.load_lines import experiments
from mitsuba_taxel.characterise.shape_error import COURSE, VARIANTS

LOADS = np.linspace(0.0, -2.0, 6)
VARIANT_COUNT, REPLICATES = 3, 32
CHANGE, BEND = 0.25, 0.03
"""Change of the reading over all loads, relative to the reading at rest; and nonlinearity, relative to this change."""
ERROR = 0.01
"""Standard deviation of errors at the last load, relative to the change."""
FIGURES = ("relative_slope", "nonlinearity")
SPREAD = 4.0
"""Half range of the variants' true figures of merit, and of limits, in units of these errors. In a small range, the
variant that seems best would owe its rank to its error more often than stated, because the probabilities assume no
prior range."""
SHARED_NOISE = 0.8
"""Fraction of the light's noise variance that is common to all variants, as they use the same random numbers."""
ERRORS = ("elements", "light", "elements and light")

Truth = tuple[np.ndarray, np.ndarray]


def comparison_cases() -> dict[str, Callable[[int], dict[str, float]]]:
    """All cases of differences, by name. A case is a function of a seed that returns the error of the difference
    between two variants, divided by its stated error."""
    return {name: partial(_behind, by, errors) for name, by, errors in _kinds()}


def probability_cases() -> dict[str, Callable[[int], dict[str, Truth]]]:
    """All cases of probabilities, by name. A case is a function of a seed that returns, by event, the stated
    probability of each variant and whether the event occurred for it.

    The events are that a variant is the best, and that it meets a limit.
    """
    return {name: partial(_probabilities, by, errors) for name, by, errors in _kinds()}


def _kinds() -> list[tuple[str, str, str]]:
    return [(f"compare: {by}, errors of {errors}", by, errors) for by in FIGURES for errors in ERRORS]


def _sizes(errors: str) -> dict[str, float]:
    """Approximate errors of the figures of merit: of the relative slope in %/N, and of the nonlinearity in %. Errors of
    finite elements affect the nonlinearity only as far as they change along the load path."""
    course = 1.0 if "light" in errors else COURSE
    return {"relative_slope": 100 * CHANGE * ERROR / 2, "nonlinearity": 13 * ERROR * course}


def _behind(by: str, errors: str, seed: int) -> dict[str, float]:
    """Error of the difference of two variants, divided by its stated error.

    Only two variants are compared: with more, ranking would favour variants whose errors happen to be large."""
    study, true_study = (study.isel(case=[0, 1]) for study in _made_up(errors, seed))
    table = compare({"made up": study}, by).table.sort_values("case")
    residual = np.diff(table[by].to_numpy()) - np.diff(_figures(true_study)[by])
    return {"behind": float(residual[0] / table.behind_error.max())}


def _probabilities(by: str, errors: str, seed: int) -> dict[str, Truth]:
    """Stated probabilities and outcomes of both events. The limit is on the other figure of merit, near the value of a
    random variant."""
    study, true_study = _made_up(errors, seed)
    random = np.random.default_rng([seed, 1])
    (limited_figure,) = {*FIGURES} - {by}
    true_figures = _figures(true_study)
    limited_values, ranked_values = np.abs(true_figures[limited_figure]), true_figures[by]
    limit = float(random.choice(limited_values) + SPREAD * _sizes(errors)[limited_figure] * random.uniform(-1, 1))
    table = compare({"made up": study}, by, {limited_figure: limit}).table.sort_values("case")
    within = limited_values <= limit
    score = np.where(within, -ranked_values if by == "nonlinearity" else np.abs(ranked_values), -np.inf)
    first = within & (score == score.max())
    return {"first": (table["first"].to_numpy(), first), "allowed": (table["allowed"].to_numpy(), within)}


def _made_up(errors: str, seed: int) -> tuple[xr.Dataset, xr.Dataset]:
    """Make two synthetic studies of the same variants: one of readings with errors and stated errors, one of true
    readings.

    The error due to finite elements is the stated error times the sum of a normal random number, which is common to the
    whole load path, and a smooth random function of the load of a tenth of the size. An eighth of the variance differs
    between variants. The noise of each replicate is a smooth random function of the load.
    """
    random, x = np.random.default_rng(seed), LOADS / LOADS[-1]
    case = (VARIANT_COUNT, 1)
    change = CHANGE * (1 + SPREAD * ERROR * random.uniform(-1, 1, case))
    bend = BEND + SPREAD * _sizes(errors)["nonlinearity"] / 100 * random.uniform(-1, 1, case)
    true = 1e-3 * (1 + change * (x + 4 * bend * x * (1 - x)))
    size = 1e-3 * ERROR * CHANGE * x * np.ones(case)
    readings, deviation = np.repeat(true[:, :, None], REPLICATES, axis=2), 0 * true
    if "elements" in errors:
        deviation = size / ERROR_SHARE
        course = COURSE * _courses(random, VARIANTS, VARIANT_COUNT)
        common, individual = (random.normal(size=(count, 1)) for count in (1, VARIANT_COUNT))
        course += np.sqrt(VARIANTS) * common + np.sqrt(1 - VARIANTS) * individual
        readings += (size * course)[:, :, None]
    if "light" in errors:
        courses = [_courses(random, SHARED_NOISE, VARIANT_COUNT) for _ in range(REPLICATES)]
        readings += np.sqrt(REPLICATES) * size[:, :, None] * np.stack(courses, axis=2)
    return _study(readings, deviation), _study(np.repeat(true[:, :, None], 2, axis=2), 0 * true)


def _courses(random: np.random.Generator, shared: float, count: int) -> np.ndarray:
    """Smooth random functions of the load with unit variance, (count, loads). The fraction ``shared`` of the variance
    is common to all."""
    kernel = np.exp(-((LOADS[:, None] - LOADS) ** 2) / (2 * LOADS[-1] ** 2))
    common, individual = (random.multivariate_normal(0 * LOADS, kernel, n, method="eigh") for n in (1, count))
    return np.sqrt(shared) * common + np.sqrt(1 - shared) * individual


def _study(power: np.ndarray, deviation: np.ndarray) -> xr.Dataset:
    """Make a study of readings (variants, loads, replicates) in W, with the deviation (variants, loads) on coarser
    finite elements."""
    dims = ["case", "fz", "replicate", "taxel"]
    variables = {
        "replicate_power": (dims, power[..., None]),
        "deviation": (["case", "fz", "taxel"], deviation[..., None]),
    }
    coords = {"case": np.arange(float(len(power))), "fz": LOADS, "taxel": [1]}
    return xr.Dataset(variables, coords, {"curve": "fz", "seed": 0, "points": 64})


def _figures(study: xr.Dataset) -> dict[str, np.ndarray]:
    """Figures of merit (variants,) of readings without errors, by name."""
    table = characteristics(experiments(study)).sort_values("case")
    return {name: table[table.figure == name].value.to_numpy() for name in FIGURES}
