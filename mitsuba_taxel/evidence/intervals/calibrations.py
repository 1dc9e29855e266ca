"""Coverage of prediction intervals: forces that a calibration computes from synthetic readings on new load paths."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr

from mitsuba_taxel.surrogates import calibrate

NOISES = ("common to a path", "of single rows", "of both kinds")
PATHS = (4, 12)
LARGEST, ROWS = 10.0, 21
"""Largest force in N, and number of rows of a path."""
NEW_PATHS, NEW_ROWS = 20, 3
STIFFNESS, ROW_NOISE = 0.03, 0.003
"""Relative standard deviations of the stiffness from path to path, and of each reading."""


def calibration_cases() -> dict[str, Callable[[int], dict[str, np.ndarray]]]:
    """All cases by name. A case is a function of a seed that returns the errors of predicted forces, divided by half of
    the stated half width."""
    return {
        f"calibrate: {paths} paths, errors {noise}": partial(_deviations, paths, noise)
        for paths in PATHS
        for noise in NOISES
    }


def _deviations(paths: int, noise: str, seed: int) -> dict[str, np.ndarray]:
    """Errors of predicted forces, divided by half of the stated half width. The interval has a coverage of 95.45 %, so
    that its half width is two standard deviations.

    The new load paths have the same distribution as those of the calibration study.
    """
    random = np.random.default_rng(seed)
    force = np.linspace(0, -LARGEST, ROWS)
    power = _readings(np.tile(force, (paths, 1)), noise, random)
    coords = {"x": np.arange(paths), "fz": force, "taxel": [1, 2]}
    study = xr.Dataset({"power": (["x", "fz", "taxel"], power)}, coords, {"curve": "fz"})
    calibration = calibrate(study, coverage=math.erf(math.sqrt(2)), noise=0.0)
    new_forces = random.uniform(-LARGEST, 0, (NEW_PATHS, NEW_ROWS))
    new_readings = _readings(new_forces, noise, random).reshape(-1, 2)
    residual = calibration.polynomial(new_readings)[:, 0] - new_forces.ravel()
    return {"force": 2 * residual / calibration.half_width[0]}


def _readings(force: np.ndarray, noise: str, random: np.random.Generator) -> np.ndarray:
    """Synthetic readings in W of two taxels with curved characteristics, at ``force`` (paths, rows); the result has the
    shape (paths, rows, taxels)."""
    stiffness = 1 + STIFFNESS * (noise != "of single rows") * random.normal(size=(len(force), 1))
    loading = force / LARGEST / stiffness
    power = 1e-3 * np.stack([1 - 0.4 * loading * (1 + 0.2 * loading), 1 + 0.2 * loading], axis=-1)
    return power * (1 + ROW_NOISE * (noise != "common to a path") * random.normal(size=power.shape))
