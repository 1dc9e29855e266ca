"""Made-up measurements whose unknowns are known: intervals of fits, by the noise of data and the errors of a model."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.fitting.model_error import ModelError, carried
from mitsuba_taxel.fitting.plan import Unknown
from mitsuba_taxel.fitting.solve import interval, solve

FORCE = np.linspace(0, 1, 15)
"""Relative to the largest."""
SOFTNESS, GAIN, OFFSET = 0.7, 3.0, 0.2
REPLICATES = 32
QUANTILE = 1.959963984540054
"""Half width of a 95 % interval, in standard deviations."""


class _Kind(NamedTuple):
    """Whether there is an offset as third unknown, the data's errors are known, and there is a bound near the truth;
    largest relative error of the model by elements, and by light of one randomisation; how elements' errors go along
    the path: with the displacement, alike, or by a random walk."""

    offset: bool = False
    known: bool = True
    bound: bool = False
    elements: float = 0.0
    light: float = 0.0
    along: str = "displacement"


KINDS = {
    "exact model": _Kind(),
    "exact model, errors by residuals": _Kind(known=False),
    "correlated unknowns": _Kind(offset=True),
    "truth near a bound": _Kind(bound=True),
    "model with errors of light": _Kind(light=0.05),
    "model with errors of elements as the displacement": _Kind(elements=0.01),
    "model with errors of elements that wander": _Kind(elements=0.01, along="walk"),
    "correlated unknowns, model with both errors": _Kind(offset=True, elements=0.01, light=0.02, along="walk"),
}


def fit_cases() -> dict[str, Callable[[int], dict[str, float]]]:
    """By name: for a seed, the error of each unknown over the half width of its interval, in standard deviations."""
    return {f"fit: {name}": partial(_deviations, kind) for name, kind in KINDS.items()}


def _deviations(kind: _Kind, seed: int) -> dict[str, float]:
    random = np.random.default_rng(seed)
    truth = np.array([SOFTNESS, GAIN, OFFSET][: 3 if kind.offset else 2])
    sigma = 10 ** random.uniform(-3, -2)
    data = _right(truth)[0] + sigma * random.normal(size=FORCE.size)
    elements, stated = _elements(kind, random)
    # All settings share their random numbers in part.
    noise = random.normal(size=(REPLICATES, 1)) + 0.5 * random.normal(size=(REPLICATES, FORCE.size))
    light = kind.light * noise

    def model(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, slopes = _right(unknowns)
        factor = 1 + elements + light.mean(axis=0)
        return value * factor, slopes * factor[:, None]

    low = SOFTNESS * (1 - 0.002 * random.random()) if kind.bound else 0.05
    names, starts = ("softness", "gain", "offset"), (1.0, 2.0, 0.1)
    unknowns = [Unknown(*each, -np.inf, np.inf) for each in zip(names, starts, strict=True)][: len(truth)]
    unknowns[0] = Unknown("softness", 1.0, low, 5.0)
    found = solve(model, data, np.full_like(data, sigma) if kind.known else None, unknowns)
    right = _right(found.values)[0]
    error = ModelError(
        (right * (1 + elements + light))[..., None],
        (right * stated)[:, None],
        np.zeros((FORCE.size, 1)),
        found.by_reading[..., None],
        np.arange(FORCE.size),
    )
    half_width = interval(found, carried(error).total)
    return dict(zip(names, (QUANTILE * (found.values - truth) / half_width).tolist(), strict=False))


def _right(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Readings and their derivatives: a bent curve of the force times softness, a gain, and an offset or none."""
    softness, gain = unknowns[:2]
    moved = softness * FORCE
    shape, slope = 1 + 0.4 * moved + 0.15 * moved**2, 0.4 + 0.3 * moved
    columns = [gain * slope * FORCE, shape, np.ones_like(FORCE)][: len(unknowns)]
    return gain * shape + (unknowns[2] if len(unknowns) > 2 else 0.0), np.stack(columns, axis=1)


def _elements(kind: _Kind, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Relative error of each reading by the finite elements, and one standard deviation of it as a study states it."""
    stated = kind.elements * FORCE
    if kind.along == "displacement":
        return stated * random.normal(), stated
    walk = np.cumsum(random.normal(size=FORCE.size)) / np.sqrt(np.arange(1, FORCE.size + 1))
    return stated * walk, stated
