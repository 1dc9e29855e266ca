"""Errors of figures of merit by those of a pad's shape: the figures of readings changed by these errors.

A reading's deviation by the finite elements changes slowly along a path, so most of it is common to all readings and
cancels in a slope. Facets of curved walls change all readings of a path, and so the slope, by nearly the same share.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from mitsuba_taxel.base.convergence import ERROR_SHARE


def off_by_shape(study: xr.Dataset) -> list[xr.Dataset]:
    """The study with readings changed by each of its errors of the pads' shape."""
    return [off(study) for name, off in _OFF.items() if name in study]


def scenes_off_by_shape(study: xr.DataTree) -> list[xr.DataTree]:
    """The study with readings changed by each error of the pads' shape that one of its scenes has."""
    return [study.map_over_datasets(off) for name, off in _OFF.items() if any(name in leaf for leaf in study.leaves)]


def with_shape(error: np.ndarray, value: np.ndarray, off: Sequence[np.ndarray]) -> np.ndarray:
    """Errors of the light combined with the changes of the values by each error of the shape."""
    return np.sqrt(error**2 + sum((other - value) ** 2 for other in off))


def _deviating(study: xr.Dataset) -> xr.Dataset:
    """The study with all readings changed by the error of the mechanics, from their ``deviation``."""
    if "deviation" not in study:
        return study
    # Readings of unknown error are unchanged; the study's notes say so.
    return study.assign(replicate_power=study.replicate_power + ERROR_SHARE * study.deviation.fillna(0.0))


def _faceted(study: xr.Dataset) -> xr.Dataset:
    """The study with all readings along a curve changed by the same share, the mean of their ``geometry_error``."""
    if "geometry_error" not in study:
        return study
    power = study.replicate_power.mean("replicate")
    share = study.geometry_error / power.where(power > 0)
    alike = [dim for dim in (study.attrs["curve"], "taxel") if dim in share.dims]
    return study.assign(replicate_power=study.replicate_power * (1 + share.mean(alike).fillna(0.0)))


_OFF = {"deviation": _deviating, "geometry_error": _faceted}
