"""Made-up variants of a sensor whose best one is known: probabilities and differences of `compare`."""

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
"""Change of the reading over the loads, relative to that at rest, and nonlinearity, relative to the change."""
ERROR = 0.01
"""Standard deviation of errors at the last load, relative to the change."""
FIGURES = ("relative_slope", "nonlinearity")
SPREAD = 4.0
"""Range of the variants' true figures to either side, and of limits, in these errors. If it were small, a variant that
seems the best would be so by its error more often than a probability that knows of no such range states."""
SHARED_NOISE = 0.8
"""Share of the variance of the light's noise that random numbers which variants share have in common."""
ERRORS = ("elements", "light", "elements and light")

Truth = tuple[np.ndarray, np.ndarray]


def comparison_cases() -> dict[str, Callable[[int], dict[str, float]]]:
    """By name: for a seed, the error of a difference from the first variant over the stated one."""
    return {name: partial(_behind, by, errors) for name, by, errors in _kinds()}


def probability_cases() -> dict[str, Callable[[int], dict[str, Truth]]]:
    """By name: for a seed, stated probabilities (variants,), and whether they came true, of being the first and of
    being within a limit."""
    return {name: partial(_probabilities, by, errors) for name, by, errors in _kinds()}


def _kinds() -> list[tuple[str, str, str]]:
    return [(f"compare: {by}, errors of {errors}", by, errors) for by in FIGURES for errors in ERRORS]


def _sizes(errors: str) -> dict[str, float]:
    """Errors of the figures in %/N and %, about; of those of elements, a nonlinearity has the random course alone."""
    course = 1.0 if "light" in errors else COURSE
    return {"relative_slope": 100 * CHANGE * ERROR / 2, "nonlinearity": 13 * ERROR * course}


def _behind(by: str, errors: str, seed: int) -> dict[str, float]:
    """Of two variants whichever is the first: ranks of more would choose those whose errors favour them."""
    read, true = (study.isel(case=[0, 1]) for study in _made_up(errors, seed))
    table = compare({"made up": read}, by).table.sort_values("case")
    missed = np.diff(table[by].to_numpy()) - np.diff(_figures(true)[by])
    return {"behind": float(missed[0] / table.behind_error.max())}


def _probabilities(by: str, errors: str, seed: int) -> dict[str, Truth]:
    """The limit is one of the other figure, beside that of a random variant."""
    read, true = _made_up(errors, seed)
    random = np.random.default_rng([seed, 1])
    (other,) = {*FIGURES} - {by}
    right = _figures(true)
    limited, ranked = np.abs(right[other]), right[by]
    limit = float(random.choice(limited) + SPREAD * _sizes(errors)[other] * random.uniform(-1, 1))
    table = compare({"made up": read}, by, {other: limit}).table.sort_values("case")
    within = limited <= limit
    score = np.where(within, -ranked if by == "nonlinearity" else np.abs(ranked), -np.inf)
    first = within & (score == score.max())
    return {"first": (table["first"].to_numpy(), first), "allowed": (table["allowed"].to_numpy(), within)}


def _made_up(errors: str, seed: int) -> tuple[xr.Dataset, xr.Dataset]:
    """Readings of variants in error, with stated errors, and true ones.

    The error of the elements is as large as stated, times a normal number of the whole path and a random course of a
    tenth of its size, which variants have in common but for an eighth of the variance; the noise of each replicate is a
    smooth random course.
    """
    random, x = np.random.default_rng(seed), LOADS / LOADS[-1]
    case = (VARIANT_COUNT, 1)
    change = CHANGE * (1 + SPREAD * ERROR * random.uniform(-1, 1, case))
    bend = BEND + SPREAD * _sizes(errors)["nonlinearity"] / 100 * random.uniform(-1, 1, case)
    true = 1e-3 * (1 + change * (x + 4 * bend * x * (1 - x)))
    size = 1e-3 * ERROR * CHANGE * x * np.ones(case)
    read, deviation = np.repeat(true[:, :, None], REPLICATES, axis=2), 0 * true
    if "elements" in errors:
        deviation = size / ERROR_SHARE
        course = COURSE * _courses(random, VARIANTS, VARIANT_COUNT)
        common, own = (random.normal(size=(count, 1)) for count in (1, VARIANT_COUNT))
        course += np.sqrt(VARIANTS) * common + np.sqrt(1 - VARIANTS) * own
        read += (size * course)[:, :, None]
    if "light" in errors:
        courses = [_courses(random, SHARED_NOISE, VARIANT_COUNT) for _ in range(REPLICATES)]
        read += np.sqrt(REPLICATES) * size[:, :, None] * np.stack(courses, axis=2)
    return _study(read, deviation), _study(np.repeat(true[:, :, None], 2, axis=2), 0 * true)


def _courses(random: np.random.Generator, shared: float, count: int) -> np.ndarray:
    """(count, loads) smooth courses of unit variance, with a share of their variance in common."""
    kernel = np.exp(-((LOADS[:, None] - LOADS) ** 2) / (2 * LOADS[-1] ** 2))
    common, own = (random.multivariate_normal(0 * LOADS, kernel, n, method="eigh") for n in (1, count))
    return np.sqrt(shared) * common + np.sqrt(1 - shared) * own


def _study(power: np.ndarray, deviation: np.ndarray) -> xr.Dataset:
    """Of readings (variants, loads, replicates) in W and their deviation (variants, loads)."""
    dims = ["case", "fz", "replicate", "taxel"]
    variables = {
        "replicate_power": (dims, power[..., None]),
        "deviation": (["case", "fz", "taxel"], deviation[..., None]),
    }
    coords = {"case": np.arange(float(len(power))), "fz": LOADS, "taxel": [1]}
    return xr.Dataset(variables, coords, {"curve": "fz", "seed": 0, "points": 64})


def _figures(study: xr.Dataset) -> dict[str, np.ndarray]:
    """(variants,) of each figure of readings without errors."""
    table = characteristics(experiments(study)).sort_values("case")
    return {name: table[table.figure == name].value.to_numpy() for name in FIGURES}
