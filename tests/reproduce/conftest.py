"""Studies made up from known curves, as a rerun would have them."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

REPLICATES = 32


def study(dims: dict[str, np.ndarray], power: np.ndarray, noise: float, seed: int = 0, **attrs: object) -> xr.Dataset:
    """A study over ``dims`` and taxel whose replicates scatter about ``power`` (*dims, taxels) by ``noise``."""
    random = np.random.default_rng(seed)
    replicates = power[..., None, :] + noise * random.normal(size=(*power.shape[:-1], REPLICATES, power.shape[-1]))
    error = replicates.std(axis=-2, ddof=1) / np.sqrt(REPLICATES)
    names = list(dims)
    return xr.Dataset(
        {
            "power": ([*names, "taxel"], replicates.mean(axis=-2)),
            "standard_error": ([*names, "taxel"], error),
            "replicate_power": ([*names, "replicate", "taxel"], replicates),
            "total_error": ([*names, "taxel"], np.hypot(error, 1e-3 * replicates.mean(axis=-2))),
            "roof_error": (names, np.full(power.shape[:-1], 1e-3)),
            "seconds": ([*names, "stage"], np.ones((*power.shape[:-1], 2))),
        },
        coords={**dims, "taxel": np.arange(1, power.shape[-1] + 1), "stage": ["load", "optics"]},
        attrs={
            "pilot_seconds": json.dumps({"optics": 2.0}),
            "wall_seconds": 3.0,
            "points": 64,
            "failures": "",
            **attrs,
        },
    )


@pytest.fixture
def make_study():
    return study
