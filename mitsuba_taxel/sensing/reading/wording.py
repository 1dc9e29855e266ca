"""Sentences on errors, light and time, used in terminal, notebook and web page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from mitsuba_taxel.base.units import in_percent

if TYPE_CHECKING:
    import xarray as xr


def light_of_study(study: xr.Dataset) -> str:
    """Describe the method by which the light of a study's readings was computed.

    Parameters
    ----------
    study : xr.Dataset
        Result of ``sweep``.

    Returns
    -------
    str
        Part of a sentence.
    """
    if points := study.attrs["points"]:
        return f"from {study.sizes['replicate']} randomisations of {points} points"
    random = int((study.standard_error > 0).sum())
    return f"without random numbers{f', but {random} that need random paths' if random else ''}"


def budget_line(budget: Mapping[str, float]) -> str:
    """Error budget as one line: ``Error of the worst reading: light 0.20%, mechanics 0.30%, geometry 0.01%, total
    0.36%``.

    Parameters
    ----------
    budget : Mapping[str, float]
        Largest relative error of any taxel by source, as from :func:`error_budget`.

    Returns
    -------
    str
        One line.
    """
    return f"Error of the worst reading: {', '.join(f'{source} {error}' for source, error in budget_rows(budget))}"


def budget_rows(budget: Mapping[str, float]) -> list[tuple[str, str]]:
    """Error budget as rows of a table: each source of error with its relative error in percent.

    Parameters
    ----------
    budget : Mapping[str, float]
        Largest relative error of any taxel by source, as from :func:`error_budget`.

    Returns
    -------
    list[tuple[str, str]]
        Rows in the order of the budget.
    """
    return [(source, in_percent(error)) for source, error in budget.items()]


def stage_line(seconds: Mapping[str, float]) -> str:
    """Computing time as one line: ``Seconds: mechanics 3.2, optics 0.4, total 3.6``.

    Parameters
    ----------
    seconds : Mapping[str, float]
        Seconds by stage.

    Returns
    -------
    str
        One line.
    """
    stages = [f"{stage} {value:.2f}" for stage, value in seconds.items()]
    return f"Seconds: {', '.join(stages)}, total {sum(seconds.values()):.2f}"
