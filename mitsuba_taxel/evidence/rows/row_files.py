"""Tables whose rows are stored in a file, so that a long run can be stopped and resumed."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, fields
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.evidence.rows.isolated_process import Measurable
from mitsuba_taxel.studies.plan.files import check_new_file

Row = TypeVar("Row", bound=Any)


class Named(Protocol):
    """Interface: an object with a name in a table."""

    @property
    def name(self) -> str: ...


class NamedCase(Named, Measurable, Protocol):
    """Interface: a named case of a table."""


AnyCase = TypeVar("AnyCase", bound=NamedCase)
AnyNamed = TypeVar("AnyNamed", bound=Named)


def chosen(cases: Sequence[AnyCase], only: str | None) -> list[AnyCase]:
    """Select the cases of a table by a pattern of their names; at least one case must match.

    Parameters
    ----------
    cases : sequence of NamedCase
        All cases of a table.
    only : str or None
        Pattern for a part of the name, with the wildcards * and ?; None selects all.

    Returns
    -------
    list
        The selected cases, in the order of the table.

    Raises
    ------
    InputError
        if no case matches.
    """
    if not (cases := matching(cases, only)):
        raise InputError(f"only = {only!r} is not allowed: a part of the name of a case is needed.")
    return cases


def matching(cases: Sequence[AnyNamed], only: str | None) -> list[AnyNamed]:
    """Select the cases whose names contain a pattern with the wildcards * and ?. All cases are selected if the pattern
    is None; the result may be empty."""
    return [case for case in cases if only is None or fnmatchcase(case.name, f"*{only}*")]


class ResumedTable(Generic[Row]):
    """A table whose cases are measured one by one, with the results stored in a file.

    Parameters
    ----------
    name : str
        Subcommand of ``taxel bench`` that writes the table.
    cases : sequence
        All cases, each with a ``name``, in the order of the table.
    row : type
        Dataclass of the rows, whose field ``case`` is the name of the case.
    measure : Callable
        Measures a case and returns its row.
    write_page : Callable[[Sequence[Row], Path, str], None]
        Writes rows as a page; the last argument is the command that the page names.
    repeats : Callable[[Row], bool]
        Whether the case of a stored row is measured again, for example because it failed.
    """

    def __init__(
        self,
        name: str,
        cases: Sequence[Any],
        row: type[Row],
        measure: Callable[[Any], Row],
        write_page: Callable[[Sequence[Row], Path, str], None],
        repeats: Callable[[Row], bool] = lambda row: False,
    ) -> None:
        self._name, self._cases, self._row = name, cases, row
        self._measure, self._write_page, self._repeats = measure, write_page, repeats

    def rows(
        self,
        only: str | None,
        csv_file: Path | None,
        markdown: Path | None,
        starting: Callable[[int, int, str], None] | None,
    ) -> Iterator[Row]:
        """Measure the selected cases that are not yet in the file, and yield the rows of all selected cases.

        Parameters
        ----------
        only : str or None
            Pattern for a part of the cases' names, with the wildcards * and ?.
        csv_file : Path or None
            File of the rows measured so far, whose cases are not measured again.
        markdown : Path or None
            Page that is rewritten after each row; it contains all rows of the file.
        starting : Callable[[int, int, str], None] or None
            Called before each case with its number, the number of all cases, and its name.

        Raises
        ------
        InputError
            if no case matches, if a file cannot be written, or if the existing CSV file is of another table.
        """
        # Refuse bad arguments before any case is measured.
        cases = chosen(self._cases, only)
        for file, suffix in ((csv_file, ".csv"), (markdown, ".md")):
            if file:
                check_new_file(file, suffix)
        measured = read_rows(csv_file, self._row) if csv_file and csv_file.exists() else {}
        command = command_of(self._name, csv_file, markdown)
        # Measure missing rows, and write the files after each, so that an interrupted run loses nothing.
        for number, case in enumerate(cases, start=1):
            if starting:
                starting(number, len(cases), case.name)
            if case.name not in measured or self._repeats(measured[case.name]):
                measured[case.name] = self._measure(case)
            ordered = [measured[listed.name] for listed in self._cases if listed.name in measured]
            if csv_file:
                unlisted = [row for name, row in measured.items() if name not in {case.name for case in self._cases}]
                write_rows([*ordered, *unlisted], csv_file)  # rows of an earlier list stay
            if markdown:
                self._write_page(ordered, markdown, command)
            yield measured[case.name]


def not_measured(cases: Sequence[NamedCase], rows: Sequence[Any]) -> str:
    """Write the paragraph of a page that lists the cases without a row.

    Parameters
    ----------
    cases : sequence of NamedCase
        All cases of the table.
    rows : sequence
        Measured rows, whose field ``case`` is the name of a case.

    Returns
    -------
    str
        Paragraph in Markdown.
    """
    measured = {row.case for row in rows}
    names = [case.name for case in cases if case.name not in measured]
    return f"Not measured yet ({len(names)}): {'; '.join(names)}." if names else "All cases are measured."


def command_of(name: str, csv_file: Path | None, markdown: Path | None) -> str:
    """Compose the command line that writes the files of a table, as the page shows it.

    Parameters
    ----------
    name : str
        Subcommand of ``taxel bench``.
    csv_file, markdown : Path or None
        Output files.
    """
    return f"taxel bench {name} --csv {csv_file or 'FILE.csv'} --markdown {markdown}"


def read_rows(file: Path, kind: type[Row]) -> dict[str, Row]:
    """Read a CSV file of rows that :func:`write_rows` wrote, with one row for each case.

    Parameters
    ----------
    file : Path
        CSV file.
    kind : type
        Dataclass of its rows.

    Returns
    -------
    dict[str, Row]
        Rows by the name of their case.

    Raises
    ------
    InputError
        if the file cannot be read, or does not contain such rows.
    """
    return {row.case: row for row in read_all_rows(file, kind)}


def read_all_rows(file: Path, kind: type[Row]) -> list[Row]:
    """Read a CSV file of rows that :func:`write_rows` wrote.

    Parameters
    ----------
    file : Path
        CSV file.
    kind : type
        Dataclass of its rows.

    Returns
    -------
    list[Row]
        Rows in the order of the file.

    Raises
    ------
    InputError
        if the file cannot be read, or does not contain such rows.
    """
    types: dict[str, type] = {field.name: str if field.type == "str" else float for field in fields(kind)}
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            reader = csv.DictReader(stream)
            return [kind(**{name: types[name](text) for name, text in row.items()}) for row in reader]
    except (KeyError, OSError, TypeError, ValueError) as error:
        raise InputError(f"{file} is not allowed: a file of rows that this command wrote is needed.") from error


def write_rows(rows: Iterable[Any], file: Path) -> None:
    """Write rows to a CSV file, with a line of headings and numbers in full precision; missing numbers are ``nan``.

    Parameters
    ----------
    rows : iterable of dataclass instances
        At least one row, all of one class.
    file : Path
        CSV file, which is replaced.
    """
    rows = list(rows)
    with replacing(file) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, [field.name for field in fields(rows[0])])
        writer.writeheader()
        writer.writerows(map(asdict, rows))
