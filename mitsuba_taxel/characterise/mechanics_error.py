"""What the error of the mechanics does to figures of merit: they are formed once more of readings that are off by it.

A reading's deviation changes slowly along a path, so that most of it is in all readings alike and drops out of a slope.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from mitsuba_taxel.base.convergence import ERROR_SHARE


def deviating(study: xr.Dataset) -> xr.Dataset:
    """The study with all readings off by what their ``deviation`` says of the error; as it is where it has none."""
    if "deviation" not in study:
        return study
    # What is not known stays what it is: the study's notes say so.
    return study.assign(replicate_power=study.replicate_power + ERROR_SHARE * study.deviation.fillna(0.0))


def with_mechanics(error: np.ndarray, value: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Errors of the light together with what the mechanics' error makes of the values."""
    return np.hypot(error, np.abs(off - value))
