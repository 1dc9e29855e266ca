"""Sensitivity: the slope of a reading against force, with the error that the readings' replicates give it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.studies.units import FORCES

if TYPE_CHECKING:
    import pandas


def sensitivity(study: xr.Dataset, force: str) -> xr.Dataset:
    """Slopes of the readings along one force component.

    The maximum slope is the one between neighbouring load steps that is largest in magnitude, which the
    literature on this kind of sensor calls the sensitivity of a simulated taxel. The largest of many noisy
    slopes is too large; so each half of the replicates takes its slope where the other half is steepest. The
    mean slope joins the first and the last step. The scatter of the replicates' slopes gives the errors.

    Parameters
    ----------
    study : as ``sweep`` returns it
    force : ``fx``, ``fy`` or ``fz``, one of its dimensions with at least two values

    Returns
    -------
    Over the other varied parameters and ``taxel``: ``max_slope``, ``max_slope_error``, ``mean_slope``,
    ``mean_slope_error`` in W/N, and ``max_slope_at``, the middle of the steepest step, in N.

    Raises
    ------
    InputError
        if ``force`` is not varied, or has one value only.
    """
    if force not in study.dims or study.sizes[force] < 2:
        raise InputError(f"{force} has no slope in this study: at least two values of it are needed.")
    power = study.replicate_power.sortby(force)
    at = power[force]
    steps = power.diff(force) / at.diff(force)
    middle = ((at + at.shift({force: 1})) / 2).isel({force: slice(1, None)})
    steepest = abs(steps.mean("replicate")).argmax(force)
    halves = [steps.isel(replicate=slice(start, None, 2)) for start in (0, 1)]
    max_slope = xr.concat(
        [
            half.isel({force: abs(other.mean("replicate")).argmax(force)}).drop_vars(force)
            for half, other in (halves, halves[::-1])
        ],
        dim="replicate",
    )
    mean_slope = (power.isel({force: -1}) - power.isel({force: 0})) / float(at[-1] - at[0])
    result = xr.Dataset(
        {
            "max_slope": max_slope.mean("replicate"),
            "max_slope_error": _standard_error(max_slope),
            "max_slope_at": (steepest.dims, middle.values[steepest.values]),
            "mean_slope": mean_slope.mean("replicate"),
            "mean_slope_error": _standard_error(mean_slope),
        }
    ).drop_vars(force, errors="ignore")
    for name, variable in result.data_vars.items():
        variable.attrs["units"] = "N" if name == "max_slope_at" else "W/N"
    return result


def sensitivity_table(study: xr.Dataset) -> pandas.DataFrame:
    """:func:`sensitivity` along every force component that the study varies, one row per curve and taxel.

    Columns: ``force``, the other varied parameters, ``taxel``, and the slopes with their unit in the name.
    There is no row if no force is varied.
    """
    import pandas

    tables = []
    for force in FORCES:
        if force in study.dims and study.sizes[force] > 1:
            slopes = sensitivity(study, force)
            names = {str(name): f"{name}_{'N' if name == 'max_slope_at' else 'W_per_N'}" for name in slopes.data_vars}
            table = slopes.to_dataframe().reset_index().rename(columns=names)
            others = [str(dim) for dim in slopes.max_slope.dims]
            tables.append(table[[*others, *names.values()]].assign(force=force))
    if not tables:
        return pandas.DataFrame()
    table = pandas.concat(tables, ignore_index=True)
    return table[["force", *(column for column in table.columns if column != "force")]]


def _standard_error(slopes: xr.DataArray) -> xr.DataArray:
    """Standard error of the mean over the replicates."""
    return slopes.std("replicate", ddof=1) / np.sqrt(slopes.sizes["replicate"])
