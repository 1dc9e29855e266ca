"""The three tables of `taxel bench coverage`: stated and true errors of readings, the same for results that need no
pad, and stated probabilities with observed frequencies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.evidence.coverage.coverage_cases import coverage_cases
from mitsuba_taxel.evidence.coverage.coverage_page import CoveragePage
from mitsuba_taxel.evidence.coverage.coverage_row import CoverageRow
from mitsuba_taxel.evidence.intervals.intervals import IntervalRow, interval_cases
from mitsuba_taxel.evidence.intervals.probabilities import ProbabilityRow, chosen_cases, with_all_kinds
from mitsuba_taxel.evidence.rows.isolated_process import measure_isolated
from mitsuba_taxel.evidence.rows.row_files import Named, ResumedTable, matching

MOST_SECONDS = 3600.0
MOST_MEMORY = 48 * 2**30
"""Memory limit in bytes of address space. For ten cells on elements of 0.4 mm, solvers reserve over 16 GB and use about
3 GB."""
PARTS = ("readings", "figures", "probabilities")
"""Tables of the page."""


def parts_with_cases(only: str | None, part: str | None = None) -> list[str]:
    """Find the tables that have cases whose names match a pattern.

    Parameters
    ----------
    only : str or None
        Pattern for a part of the cases' names, with the wildcards * and ?; None selects all.
    part : str or None
        One of `PARTS`, to search this table only.

    Returns
    -------
    list[str]
        Names of the tables, in the order of the page.

    Raises
    ------
    InputError
        if no case matches.
    """
    cases: dict[str, Callable[[], Sequence[Named]]]
    cases = {"readings": coverage_cases, "figures": interval_cases, "probabilities": chosen_cases}
    groups = {name: matching(cases[name](), only) for name in PARTS if part in (None, name)}
    if not any(groups.values()):
        raise InputError(f"only = {only!r} is not allowed: a part of the name of a case is needed.")
    return [name for name, group in groups.items() if group]


def coverage(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[CoverageRow]:
    """Compare stated and true errors of readings: measure each setting in a separate process, and yield its row.

    Parameters
    ----------
    only, csv_file, markdown, starting
        See `ResumedTable.rows`.

    Returns
    -------
    Iterator[CoverageRow]
        Rows in the order of the table.
    """
    page = CoveragePage(csv_file, markdown)
    table = ResumedTable(
        "coverage",
        coverage_cases(),
        CoverageRow,
        lambda case: measure_isolated(case, MOST_SECONDS, MOST_MEMORY),
        lambda rows, file, command: page.keep_readings(rows),
        repeats=lambda row: bool(row.remark),
    )
    return table.rows(only, csv_file, markdown, starting)


def figures_without_pad(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[str], None] | None = None,
) -> Iterator[IntervalRow]:
    """Compare stated and true errors of results that need no pad, such as fits of synthetic data, and yield the rows.
    Rows of earlier runs are not used.

    Parameters
    ----------
    only : str, optional
        Pattern for a part of the cases' names, with the wildcards * and ?.
    csv_file, markdown : Path, optional
        See `CoveragePage`; both are written after each case.
    starting : Callable[[str], None], optional
        Called with the name of each case.
    """
    page = CoveragePage(csv_file, markdown)
    for case in interval_cases(only):
        if starting:
            starting(case.name)
        rows = case.measured()
        page.keep_figures(rows)
        yield from rows


def probabilities(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[str], None] | None = None,
) -> Iterator[ProbabilityRow]:
    """Compare stated probabilities with observed frequencies on synthetic data, and yield the rows. Rows of earlier
    runs are not used. With several cases, rows of all cases together come last.

    Parameters
    ----------
    only, csv_file, markdown, starting
        See `figures_without_pad`.
    """
    page, measured = CoveragePage(csv_file, markdown), []
    for case in chosen_cases(only):
        if starting:
            starting(f"{case.name}, probabilities")
        rows = case.measured()
        page.keep_probabilities(rows)
        measured += rows
        yield from rows
    yield from with_all_kinds(measured)[len(measured) :]
