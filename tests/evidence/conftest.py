"""Studies made up from known curves, as a rerun would have them."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

REPLICATES = 32


def study(
    dims: dict[str, np.ndarray],
    power: np.ndarray,
    noise: float,
    seed: int = 0,
    slope: np.ndarray | None = None,
    **attrs: object,
) -> xr.Dataset:
    """A study over ``dims`` and taxel whose replicates scatter about ``power`` (*dims, taxels) by ``noise``.

    With ``slope`` (points, taxels) in W/N, one of derivatives too.
    """
    random = np.random.default_rng(seed)
    replicates = power[..., None, :] + noise * random.normal(size=(*power.shape[:-1], REPLICATES, power.shape[-1]))
    error = replicates.std(axis=-2, ddof=1) / np.sqrt(REPLICATES)
    names = list(dims)
    made = xr.Dataset(
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
            "curve": names[0],
            **attrs,
        },
    )
    return made if slope is None else _with_derivatives(made, names[0], power, slope, noise)


def _with_derivatives(made: xr.Dataset, path: str, power: np.ndarray, slope: np.ndarray, noise: float) -> xr.Dataset:
    """With slopes (points, taxels) along its only force, each known to 1e-3 of the noise; a resultant has two parts."""
    share = np.sqrt(0.5) if path == "resultant" else 1.0
    forces = ["fx", "fy"] if path == "resultant" else [path]
    parts = np.repeat(slope[..., None] * share, len(forces), axis=-1)
    if path == "resultant":
        made = made.assign_coords({name: (path, share * made[path].values) for name in forces})
    return made.assign(
        smooth_power=([path, "taxel"], power),
        derivative=([path, "taxel", "parameter"], parts),
        derivative_error=([path, "taxel", "parameter"], np.full(parts.shape, 1e-3 * noise)),
    ).assign_coords(parameter=forces)


@pytest.fixture(scope="session")
def make_study():
    return study
