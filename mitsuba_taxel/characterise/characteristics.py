"""Table of all figures of merit of experiments."""

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
"""Remark on numbers that are smaller than their standard error."""
NOT_ABOVE = "as the mean"
"""Remark on a largest slope below the mean one: the difference is noise."""


def characteristics(experiments: Iterable[Experiment], off: Changed | None = None) -> pandas.DataFrame:
    """Sensitivities, nonlinearity, hysteresis and repeatability, one number per row.

    Slopes are given for each run of growing force, the relative one as the mean slope over the reading at rest;
    nonlinearity for each branch of growing force; hysteresis for each such branch with the following one of falling
    force; repeatability for each such branch with the first one.

    Parameters
    ----------
    experiments : iterable of Experiment
        Of a study or a measurement.
    off : dict of lists of two lists of Experiment, optional
        By mode of the errors of the shape, which are to be included in the errors: the same experiments with readings
        changed by it, up and down.

    Returns
    -------
    pandas.DataFrame
        Columns: ``figure``; ``force``; the other varied parameters; ``taxel``; ``loading``, which run or branch of
        growing force, from 1; ``value`` and ``error`` in ``unit``; ``at_N``, the force where it was found; ``from_N``
        and ``to_N``, the range of forces; ``remark``, a text that replaces the value, or nothing.
    """
    import pandas

    rows = _figures(experiments)
    changed = {mode: [_column(_figures(one), "value") for one in both] for mode, both in (off or {}).items()}
    derived = np.array([row.pop("derived") for row in rows], dtype=bool)
    errors = with_shape(_column(rows, "error"), _column(rows, "value"), changed, derived)
    for row, error in zip(rows, errors.tolist(), strict=True):
        row["error"] = error
        size = row["value"] if row["figure"] in DEVIATIONS else abs(row["value"])
        if size <= row["error"]:
            row["remark"] = NOT_RESOLVED
    last = ("taxel", "loading", "value", "error", "unit", "at_N", "from_N", "to_N", "remark")
    others = dict.fromkeys(name for row in rows for name in row if name not in ("figure", "force", *last))
    return pandas.DataFrame(rows, columns=["figure", "force", *others, *last])


def _figures(experiments: Iterable[Experiment]) -> list[dict[str, Any]]:
    return [row for experiment in experiments for row in (*_slopes(experiment), *_deviations(experiment))]


def _column(rows: Sequence[Mapping[str, Any]], name: str) -> np.ndarray:
    return np.array([row[name] for row in rows], dtype=float)


def _slopes(experiment: Experiment) -> Iterator[dict[str, Any]]:
    unit, nowhere = f"{experiment.unit}/N", np.full(len(experiment.taxel), np.nan)
    for number, run in enumerate(experiment.loading_runs, start=1):
        found = slopes(run)
        places = {"max_slope": found.max_slope_at, "mean_slope": nowhere, "zero_slope": np.zeros(len(nowhere))}
        below = np.abs(found.max_slope) < np.abs(found.mean_slope)
        remarks = {"max_slope": np.where(below, NOT_ABOVE, "").tolist()}
        for name, at in places.items():
            numbers = (getattr(found, name), getattr(found, f"{name}_error"), at)
            yield from _rows(experiment, name, number, numbers, unit, run, remarks.get(name))
        if experiment.rest is not None:
            relative = relative_slope(run, found, experiment.rest)
            yield from _rows(experiment, "relative_slope", number, (*relative, nowhere), "%/N", run)


def _deviations(experiment: Experiment) -> Iterator[dict[str, Any]]:
    largest, branches = experiment.largest_change, experiment.branches
    loading = [number for number, branch in enumerate(branches) if branch.loading]
    for count, number in enumerate(loading, start=1):
        branch = branches[number]
        first = next(branches[other] for other in loading if branches[other].side == branch.side)
        found: dict[str, Deviation] = {}
        if len(branch.force) > 2:  # any two points lie on a line
            found["nonlinearity"] = nonlinearity(branch, largest)
        for after in branches[number + 1 : number + 2]:
            if not after.loading and after.side == branch.side and share_forces(branch, after):
                found["hysteresis"] = hysteresis(branch, after, largest)
        if first is not branch and share_forces(first, branch):
            found["repeatability"] = repeatability(first, branch, largest)
        for name, deviation in found.items():
            yield from _rows(experiment, name, count, deviation, "%", branch)


def _rows(
    experiment: Experiment,
    figure: str,
    loading: int,
    numbers: tuple,
    unit: str,
    part: Branch,
    remarks: Sequence[str] | None = None,
) -> Iterator[dict[str, Any]]:
    ends = part.force[[0, -1]] if len(part.force) else (np.nan, np.nan)
    remarks = remarks or [""] * len(experiment.taxel)
    for taxel, value, error, at, remark in zip(experiment.taxel.tolist(), *numbers, remarks, strict=True):
        yield {
            "figure": figure,
            "force": experiment.force,
            **experiment.where,
            "taxel": taxel,
            "loading": loading,
            **{"value": value, "error": error, "unit": unit, "at_N": at, "from_N": ends[0], "to_N": ends[1]},
            "remark": remark,
            "derived": part.tangents is not None and figure.endswith("slope"),
        }
