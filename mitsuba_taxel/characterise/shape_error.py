"""What the errors of a pad's shape do to figures of merit: these are formed once more of readings that are off by them.

A reading's deviation by the finite elements changes slowly along a path, so that most of it is in all readings alike
and drops out of a slope. Facets of curved walls change all readings of a path by nearly the same share, and a slope by
that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from mitsuba_taxel.base.convergence import ERROR_SHARE


def off_by_shape(study: xr.Dataset) -> list[xr.Dataset]:
    """The study with readings off by each error of the pads' shape that it states."""
    return [off(study) for name, off in _OFF.items() if name in study]


def scenes_off_by_shape(study: xr.DataTree) -> list[xr.DataTree]:
    """The study with readings off by each error of the pads' shape that a scene of it states."""
    return [study.map_over_datasets(off) for name, off in _OFF.items() if any(name in leaf for leaf in study.leaves)]


def with_shape(error: np.ndarray, value: np.ndarray, off: Sequence[np.ndarray]) -> np.ndarray:
    """Errors of the light together with what each error of the shape makes of the values."""
    return np.sqrt(error**2 + sum((other - value) ** 2 for other in off))


def _deviating(study: xr.Dataset) -> xr.Dataset:
    """With all readings off by what their ``deviation`` says of the error of the mechanics."""
    if "deviation" not in study:
        return study
    # What is not known stays what it is: the study's notes say so.
    return study.assign(replicate_power=study.replicate_power + ERROR_SHARE * study.deviation.fillna(0.0))


def _faceted(study: xr.Dataset) -> xr.Dataset:
    """With all readings along a curve off by the same share, the mean of those of their ``geometry_error``."""
    if "geometry_error" not in study:
        return study
    power = study.replicate_power.mean("replicate")
    share = study.geometry_error / power.where(power > 0)
    alike = [dim for dim in (study.attrs["curve"], "taxel") if dim in share.dims]
    return study.assign(replicate_power=study.replicate_power * (1 + share.mean(alike).fillna(0.0)))


_OFF = {"deviation": _deviating, "geometry_error": _faceted}
