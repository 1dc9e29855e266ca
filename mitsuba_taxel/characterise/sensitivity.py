"""Sensitivity: the slope of a reading against force, with its error due to light, mechanics and geometry."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.characterise.characteristics import NO_CHANGE, NOT_ABOVE, NOT_RESOLVED
from mitsuba_taxel.characterise.experiment import Branch
from mitsuba_taxel.characterise.load_lines import LoadLine, load_lines, loading_lines, runs, unit_of
from mitsuba_taxel.characterise.roles import with_forces_named
from mitsuba_taxel.characterise.shape_error import Mode, changed_by_shape, with_shape
from mitsuba_taxel.characterise.slopes import Slopes, relative_slope, slopes

if TYPE_CHECKING:
    import pandas


def sensitivity(study: xr.Dataset, force: str) -> xr.Dataset:
    """Sensitivity: slopes of the readings of a study along one force, with their errors.

    All scenes of a study share their random numbers, so slopes are computed for each replicate; their scatter gives the
    error of the light. Two more errors of the readings follow from the variables ``deviation`` (finite elements) and
    ``geometry_error`` (facets of curved walls) of the study. For each, the readings are raised and lowered by one
    standard deviation of this error, and the slopes are computed again: their change is added to their error. Missing
    readings are left out.

    Parameters
    ----------
    study : xr.Dataset
        Result of ``sweep``.
    force : str
        Force with respect to which slopes are computed. Either a component of the force: ``fx``, ``fy`` or ``fz``, or
        the name of a parameter with this role. It must be varied alone, as a dimension of the study or in the steps of
        a path. Or the name of the dimension of a path along which the force changes in one direction. The abscissa is
        then the component of the force in this direction, such as the resultant of a diagonal load.

    Returns
    -------
    xr.Dataset
        Dataset over the other varied parameters and ``taxel``: ``max_slope``, ``mean_slope`` and ``zero_slope`` in W/N,
        or V/N for a study in volts, each with its ``_error``; ``max_slope_at`` in N, as in :class:`Slopes`; and
        ``relative_slope`` in %/N, the mean slope over the reading at the least force, with its error.

    Raises
    ------
    InputError
        if ``force`` is not varied alone, has a single value, or grows along several runs of a path.
    """
    force = json.loads(study.attrs.get("forces", "{}")).get(force, [force])[0]
    study = with_forces_named(study)
    lines = [line for line in load_lines(study) if force in (line.name, line.dim) and line.loading]
    if not lines:
        raise InputError(f"{force} has no slope in this study: at least two values of it are needed.")
    if len(lines) > 1:
        raise InputError(
            f"{force} grows along {len(lines)} series of loads, with several slopes: use sensitivity_table for all."
        )
    return _slopes_along(study, lines[0], changed_by_shape(study))


def sensitivity_table(study: xr.Dataset) -> pandas.DataFrame:
    """Table of the slopes along every line of load of a study, one row per line and taxel; see :func:`sensitivity`.

    If a path goes up and down along a line, its first run of growing force is used. Columns: ``force``, the other
    varied parameters, ``taxel``, the slopes with their unit in the name, and ``remark`` on the largest slope. The table
    is empty if no force is varied.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene.

    Returns
    -------
    pandas.DataFrame
        A row per line and taxel.
    """
    import pandas

    study, tables = with_forces_named(study), []
    lines = loading_lines(study)
    changed_studies = changed_by_shape(study) if lines else {}
    for line in lines:
        result = _slopes_along(study, line, changed_studies)
        suffixes = {name: _unit(study, name).replace("%", "percent").replace("/", "_per_") for name in map(str, result)}
        names = {name: f"{name}_{suffix}" for name, suffix in suffixes.items()}
        table = result.to_dataframe().reset_index()
        table["remark"] = [
            NO_CHANGE
            if largest == error == 0
            else NOT_RESOLVED
            if abs(largest) <= error
            else NOT_ABOVE
            if abs(largest) < abs(mean)
            else ""
            for largest, error, mean in table[["max_slope", "max_slope_error", "mean_slope"]].to_numpy()
        ]
        table = table.rename(columns=names).assign(force=line.name, **line.constant)
        varied = [*line.constant, *(str(dim) for dim in result.max_slope.dims)]
        tables.append(table[["force", *varied, *names.values(), "remark"]])
    if not tables:
        return pandas.DataFrame()
    table = pandas.concat(tables, ignore_index=True)
    slope_columns = [name for name in table.columns if name in (*names.values(), "remark")]
    varied = [name for name in table.columns if name not in (*slope_columns, "force", "taxel")]
    return table[["force", *varied, "taxel", *slope_columns]]


def _slopes_along(study: xr.Dataset, line: LoadLine, changed_studies: dict[Mode, list[xr.Dataset]]) -> xr.Dataset:
    """The slopes along a line of load, over the other dimensions and ``taxel``. Their errors follow from the
    ``changed_studies``, whose readings are changed by errors of the shape."""
    other_dims = [dim for dim in study.replicate_power.dims if dim not in (line.dim, "replicate", "taxel")]
    shape = tuple(study.sizes[dim] for dim in (*other_dims, "taxel"))
    names = (*Slopes._fields, "relative_slope", "relative_slope_error")
    branches = [run for _, run in runs(study, line)]
    figures = np.array([_all_slopes(run) for run in branches])

    # Errors of the light become errors of light and shape.
    derived = np.array([run.tangents is not None for run in branches])
    changed_figures = {
        mode: [np.array([_all_slopes(run) for _, run in runs(changed_study, line)]) for changed_study in pair]
        for mode, pair in changed_studies.items()
    }
    for name in ("max_slope", "mean_slope", "zero_slope", "relative_slope"):
        value, error = names.index(name), names.index(f"{name}_error")
        changed = {mode: [figure[:, value] for figure in pair] for mode, pair in changed_figures.items()}
        figures[:, error] = with_shape(figures[:, error], figures[:, value], changed, derived[:, None])
    coordinates = {dim: study[dim] for dim in (*other_dims, "taxel") if dim in study.coords}
    return xr.Dataset(
        {
            name: ([*other_dims, "taxel"], figures[:, number].reshape(shape), {"units": _unit(study, name)})
            for number, name in enumerate(names)
        },
        coords=coordinates,
    )


def _all_slopes(run: Branch) -> tuple[np.ndarray, ...]:
    """The slopes of a run, the relative slope and its error, each (channels,)."""
    run_slopes = slopes(run)
    if not len(run.force):
        return (*run_slopes, run_slopes.mean_slope, run_slopes.mean_slope_error)
    return (*run_slopes, *relative_slope(run, run_slopes, run.samples[np.abs(run.force).argmin()]))


def _unit(study: xr.Dataset, name: str) -> str:
    """Unit of a figure of merit of a study, such as W/N."""
    return "N" if name == "max_slope_at" else "%/N" if name.startswith("relative") else f"{unit_of(study)}/N"
