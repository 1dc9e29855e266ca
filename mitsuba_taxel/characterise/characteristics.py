"""The table of all figures of merit of experiments."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.characterise.equations import Deviation, hysteresis, nonlinearity, repeatability, share_forces
from mitsuba_taxel.characterise.experiment import Branch, Experiment
from mitsuba_taxel.characterise.shape_error import Changed, with_shape
from mitsuba_taxel.characterise.slopes import relative_slope, slopes

if TYPE_CHECKING:
    import pandas

SLOPES = ("max_slope", "mean_slope", "zero_slope", "relative_slope")
DEVIATIONS = ("nonlinearity", "hysteresis", "repeatability")
NOT_RESOLVED = "not resolved"
"""Remark on values that are smaller than their standard error."""
NO_CHANGE = "no change"
"""Remark on values that are 0 with an error of 0, such as the slope of a saturated reading."""
NOT_ABOVE = "as the mean"
"""Remark on a largest slope below the mean slope: the difference is noise."""


def characteristics(experiments: Iterable[Experiment], off: Changed | None = None) -> pandas.DataFrame:
    """Table of sensitivity, nonlinearity, hysteresis and repeatability of experiments, one number per row.

    Slopes are computed for each run of growing force; the relative slope is the mean slope over the reading at rest.
    Nonlinearity is computed for each branch of growing force, hysteresis for each such branch and the branch of falling
    force that follows it, repeatability for each such branch and the first such branch.

    Parameters
    ----------
    experiments : iterable of Experiment
        Experiments of a study or a measurement.
    off : dict of lists of two lists of Experiment, optional
        Effect of the errors of the pad's shape, as `Simulated.off` states it. For each independent component (mode) of
        these errors: two lists of the same experiments, with readings changed by the component and by its negative.
        Errors in the table then include the errors of the shape.

    Returns
    -------
    pandas.DataFrame
        Columns: ``figure``; ``force``; the other varied parameters; ``taxel``; ``loading``, the number of the run or
        branch of growing force, from 1; ``value`` and ``error`` in ``unit``; ``at_N``, the force where the figure
        occurs; ``from_N`` and ``to_N``, the range of forces; ``remark``, a text that replaces the value, or empty.
    """
    import pandas

    # Figures of the readings, and of the readings changed by each mode of the errors of the shape.
    rows = _figures(experiments)
    changed = {
        mode: [_column(_figures(experiments), "value") for experiments in pair] for mode, pair in (off or {}).items()
    }

    # Errors of the light and of the shape together; figures below their error get a remark.
    derived = np.array([row.pop("derived") for row in rows], dtype=bool)
    errors = with_shape(_column(rows, "error"), _column(rows, "value"), changed, derived)
    for row, error in zip(rows, errors.tolist(), strict=True):
        row["error"] = error
        size = row["value"] if row["figure"] in DEVIATIONS else abs(row["value"])
        if size == row["error"] == 0:
            row["remark"] = NO_CHANGE
        elif size <= row["error"]:
            row["remark"] = NOT_RESOLVED

    # The varied parameters stand between the force and the taxel.
    columns = ("taxel", "loading", "value", "error", "unit", "at_N", "from_N", "to_N", "remark")
    varied = dict.fromkeys(name for row in rows for name in row if name not in ("figure", "force", *columns))
    return pandas.DataFrame(rows, columns=["figure", "force", *varied, *columns])


def _figures(experiments: Iterable[Experiment]) -> list[dict[str, Any]]:
    """Table rows of all slopes and deviations of experiments. The field ``derived`` marks errors that come from
    derivatives.
    """
    return [row for experiment in experiments for row in rows_of(experiment, (*SLOPES, *DEVIATIONS))]


def rows_of(experiment: Experiment, names: Iterable[str]) -> list[dict[str, Any]]:
    """Rows of the table of :func:`characteristics` of one experiment, with errors due to the light alone.

    Parameters
    ----------
    experiment : Experiment
        The experiment.
    names : iterable of str
        Figures that are needed; others may be among the rows.

    Returns
    -------
    list[dict]
        Rows, with the mark ``derived`` of errors that come from derivatives.
    """
    needed = set(names)
    of_slopes = _slopes(experiment) if needed - set(DEVIATIONS) else ()
    return [*of_slopes, *(_deviations(experiment) if needed & set(DEVIATIONS) else ())]


def _column(rows: Sequence[Mapping[str, Any]], name: str) -> np.ndarray:
    return np.array([row[name] for row in rows], dtype=float)


def _slopes(experiment: Experiment) -> Iterator[dict[str, Any]]:
    unit, no_force = f"{experiment.unit}/N", np.full(len(experiment.taxel), np.nan)
    for number, run in enumerate(experiment.loading_runs, start=1):
        run_slopes = slopes(run)
        forces = {"max_slope": run_slopes.max_slope_at, "mean_slope": no_force, "zero_slope": np.zeros(len(no_force))}
        below = np.abs(run_slopes.max_slope) < np.abs(run_slopes.mean_slope)
        remarks = {"max_slope": np.where(below, NOT_ABOVE, "").tolist()}
        for name, force in forces.items():
            numbers = (getattr(run_slopes, name), getattr(run_slopes, f"{name}_error"), force)
            yield from _rows(experiment, name, number, numbers, unit, run, remarks.get(name))
        if experiment.rest is not None:
            relative = relative_slope(run, run_slopes, experiment.rest)
            yield from _rows(experiment, "relative_slope", number, (*relative, no_force), "%/N", run)


def _deviations(experiment: Experiment) -> Iterator[dict[str, Any]]:
    largest, branches = experiment.largest_change, experiment.branches
    loading = [number for number, branch in enumerate(branches) if branch.loading]
    for count, number in enumerate(loading, start=1):
        branch = branches[number]
        first = next(branches[index] for index in loading if branches[index].side == branch.side)

        # Nonlinearity needs three points; hysteresis the falling branch that follows; repeatability an earlier branch.
        deviations: dict[str, Deviation] = {}
        if len(branch.force) > 2:
            deviations["nonlinearity"] = nonlinearity(branch, largest)
        for after in branches[number + 1 : number + 2]:
            if not after.loading and after.side == branch.side and share_forces(branch, after):
                deviations["hysteresis"] = hysteresis(branch, after, largest)
        if first is not branch and share_forces(first, branch):
            deviations["repeatability"] = repeatability(first, branch, largest)
        for name, deviation in deviations.items():
            yield from _rows(experiment, name, count, deviation, "%", branch)


def _rows(
    experiment: Experiment,
    figure: str,
    loading: int,
    numbers: tuple,
    unit: str,
    branch: Branch,
    remarks: Sequence[str] | None = None,
) -> Iterator[dict[str, Any]]:
    """Table rows of one figure, one for each taxel. ``numbers`` are the values, errors and forces, each (channels,)."""
    ends = branch.force[[0, -1]] if len(branch.force) else (np.nan, np.nan)
    remarks = remarks or [""] * len(experiment.taxel)
    for taxel, value, error, position, remark in zip(experiment.taxel.tolist(), *numbers, remarks, strict=True):
        yield {
            "figure": figure,
            "force": experiment.force,
            **experiment.where,
            "taxel": taxel,
            "loading": loading,
            **{"value": value, "error": error, "unit": unit, "at_N": position, "from_N": ends[0], "to_N": ends[1]},
            "remark": remark,
            "derived": branch.tangents is not None and figure.endswith("slope"),
        }
