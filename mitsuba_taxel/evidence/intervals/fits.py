"""Coverage of the intervals of fitted unknowns, on synthetic measurements with noise and with errors of the model."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.fitting.model_error import ModelError, carried
from mitsuba_taxel.fitting.plan import Unknown
from mitsuba_taxel.fitting.solve import interval, solve

FORCE = np.linspace(0, 1, 15)
"""Forces relative to the largest."""
SOFTNESS, GAIN, OFFSET = 0.7, 3.0, 0.2
REPLICATES = 32
QUANTILE = 1.959963984540054
"""Half width of a 95 % interval, in standard deviations."""


class _FitSetting(NamedTuple):
    """Setting of a synthetic fit.

    Attributes
    ----------
    offset : bool
        Whether an offset of the readings is fitted as a third unknown.
    known_errors : bool
        Whether the fit is given the standard errors of the data.
    bound : bool
        Whether a bound of the first unknown is close to its true value.
    elements, light : float
        Largest relative error of the model due to finite elements, and due to the light of one randomisation.
    along : str
        Change of the finite-element error along the load path: ``displacement`` (proportional to the displacement) or
        ``walk`` (a random walk).
    """

    offset: bool = False
    known_errors: bool = True
    bound: bool = False
    elements: float = 0.0
    light: float = 0.0
    along: str = "displacement"


KINDS = {
    "exact model": _FitSetting(),
    "exact model, errors by residuals": _FitSetting(known_errors=False),
    "correlated unknowns": _FitSetting(offset=True),
    "true value near a bound": _FitSetting(bound=True),
    "model with errors of light": _FitSetting(light=0.05),
    "model with errors of elements proportional to the displacement": _FitSetting(elements=0.01),
    "model with errors of elements in a random walk": _FitSetting(elements=0.01, along="walk"),
    "correlated unknowns, model with both errors": _FitSetting(offset=True, elements=0.01, light=0.02, along="walk"),
}


def fit_cases() -> dict[str, Callable[[int], dict[str, float]]]:
    """All cases by name. A case is a function of a seed that returns, for each unknown, the error divided by the
    standard deviation that its stated interval implies."""
    return {f"fit: {name}": partial(_deviations, kind) for name, kind in KINDS.items()}


def _deviations(kind: _FitSetting, seed: int) -> dict[str, float]:
    """Make noisy data, fit the unknowns, and return the error of each, divided by the standard deviation that its
    stated interval implies."""
    # Noisy data, and errors of the model.
    random = np.random.default_rng(seed)
    truth = np.array([SOFTNESS, GAIN, OFFSET][: 3 if kind.offset else 2])
    sigma = 10 ** random.uniform(-3, -2)
    data = _exact_readings(truth)[0] + sigma * random.normal(size=FORCE.size)
    element_error, stated_error = _element_errors(kind, random)
    # The readings have partly common noise.
    noise = random.normal(size=(REPLICATES, 1)) + 0.5 * random.normal(size=(REPLICATES, FORCE.size))
    light = kind.light * noise

    def model(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, slopes = _exact_readings(unknowns)
        factor = 1 + element_error + light.mean(axis=0)
        return value * factor, slopes * factor[:, None]

    # Fit the unknowns, and propagate the errors of the model to their intervals.
    low = SOFTNESS * (1 - 0.002 * random.random()) if kind.bound else 0.05
    names, starts = ("softness", "gain", "offset"), (1.0, 2.0, 0.1)
    unknowns = [Unknown(*arguments, -np.inf, np.inf) for arguments in zip(names, starts, strict=True)][: len(truth)]
    unknowns[0] = Unknown("softness", 1.0, low, 5.0)
    solution = solve(model, data, np.full_like(data, sigma) if kind.known_errors else None, unknowns)
    fitted = _exact_readings(solution.values)[0]
    error = ModelError(
        (fitted * (1 + element_error + light))[..., None],
        (fitted * stated_error)[:, None],
        np.zeros((FORCE.size, 1)),
        solution.by_reading[..., None],
        np.arange(FORCE.size),
    )
    half_width = interval(solution, carried(error).total)
    return dict(zip(names, (QUANTILE * (solution.values - truth) / half_width).tolist(), strict=False))


def _exact_readings(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Exact readings (rows,), a function of softness times force, scaled by a gain and shifted by an offset; and their
    derivatives (rows, unknowns)."""
    softness, gain = unknowns[:2]
    displacement = softness * FORCE
    shape, slope = 1 + 0.4 * displacement + 0.15 * displacement**2, 0.4 + 0.3 * displacement
    columns = [gain * slope * FORCE, shape, np.ones_like(FORCE)][: len(unknowns)]
    return gain * shape + (unknowns[2] if len(unknowns) > 2 else 0.0), np.stack(columns, axis=1)


def _element_errors(kind: _FitSetting, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Relative error of each reading due to the finite elements, and the standard deviation that a study states for
    it."""
    deviation = kind.elements * FORCE
    if kind.along == "displacement":
        return deviation * random.normal(), deviation
    walk = np.cumsum(random.normal(size=FORCE.size)) / np.sqrt(np.arange(1, FORCE.size + 1))
    return deviation * walk, deviation
