"""The tables of `taxel bench stability`: extreme cases of mechanics, readings and circuits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.evidence.extremes.cases import stability_cases
from mitsuba_taxel.evidence.extremes.circuit_cases import circuit_cases
from mitsuba_taxel.evidence.extremes.reading_cases import reading_cases
from mitsuba_taxel.evidence.extremes.solid_cases import solid_cases
from mitsuba_taxel.evidence.extremes.tables import AnyRow, write_csv, write_markdown
from mitsuba_taxel.evidence.rows.isolated_process import measure_isolated
from mitsuba_taxel.evidence.rows.row_files import NamedCase, chosen, not_measured
from mitsuba_taxel.studies.plan.files import check_new_file


def stability(
    only: str | None = None,
    csv: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[AnyRow]:
    """Measure the extreme cases of mechanics, readings and circuits, each in a separate process, and yield their rows.
    The output files are rewritten after each row.

    Parameters
    ----------
    only : str, optional
        Pattern for a part of the cases' names, with the wildcards * and ?.
    csv, markdown : Path, optional
        Output files.
    starting : Callable[[int, int, str], None], optional
        Called before each case with its number, the number of all cases, and its name.

    Raises
    ------
    InputError
        if no case matches, or a file cannot be written.
    """
    all_cases: list[NamedCase] = [*stability_cases(), *solid_cases(), *reading_cases(), *circuit_cases()]
    cases = chosen(all_cases, only)
    for file, suffix in ((csv, ".csv"), (markdown, ".md")):
        if file:
            check_new_file(file, suffix)
    rows: list[AnyRow] = []
    for number, case in enumerate(cases, start=1):
        if starting:
            starting(number, len(cases), case.name)
        rows.append(measure_isolated(case))
        if csv:
            write_csv(rows, csv)
        if markdown:
            write_markdown(rows, markdown, _command(only, markdown), not_measured(cases, rows))
        yield rows[-1]


def check(rows: Sequence[AnyRow]) -> None:
    """Raise `ComputationError` if a row counts as a failure; the message names its case."""
    wrong = [row.case for row in rows if row.wrong]
    if wrong:
        raise ComputationError(f"{len(wrong)} of {len(rows)} rows are wrong: {'; '.join(wrong)}.")


def _command(only: str | None, markdown: Path) -> str:
    return f"taxel bench stability {f'--only {only!r} ' if only else ''}--markdown {markdown}"
