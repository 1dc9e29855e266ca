"""Rows of tables that are kept in a file, so that a long run can be stopped and resumed."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, fields
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from mitsuba_taxel.base.atomic import replacing
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.evidence.rows.isolated_process import Measurable
from mitsuba_taxel.studies.plan.files import check_new_file

Row = TypeVar("Row", bound=Any)


class NamedCase(Measurable, Protocol):
    """A named case of a table."""

    @property
    def name(self) -> str: ...


AnyCase = TypeVar("AnyCase", bound=NamedCase)


def chosen(cases: Sequence[AnyCase], only: str | None) -> list[AnyCase]:
    """The cases with a part of the name that matches the pattern ``only``; raises `InputError` if there are none."""
    wanted = [case for case in cases if only is None or fnmatchcase(case.name, f"*{only}*")]
    if not wanted:
        raise InputError(f"only = {only!r} is not allowed: a part of the name of a case is needed.")
    return wanted


class ResumedTable(Generic[Row]):
    """A table whose rows are measured one by one, and kept in a file.

    Parameters
    ----------
    name : str
        Of the subcommand of ``taxel bench`` that makes it.
    cases : sequence
        All cases, each with a ``name``, in the order of the table.
    row : type
        Dataclass of the rows, whose ``case`` is the name of theirs.
    measure : Callable
        Makes the row of a case.
    write_page : Callable[[Sequence[Row], Path, str], None]
        Writes rows as a page, with the command that makes it.
    repeats : Callable[[Row], bool]
        Whether a row of the file is measured again, as one that failed may be.
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
        """The chosen rows as they are measured or read from the file.

        Parameters
        ----------
        only : str or None
            Pattern for a part of the cases' names, with the wildcards * and ?.
        csv_file : Path or None
            File of the rows measured so far, which are not measured again.
        markdown : Path or None
            Page that is rewritten after each row, with all rows of the file.
        starting : Callable[[int, int, str], None] or None
            Called with (number of a case, total number, its name).

        Raises
        ------
        InputError
            if no case matches, a file cannot be written, or an existing one holds other rows.
        """
        cases = chosen(self._cases, only)
        for file, suffix in ((csv_file, ".csv"), (markdown, ".md")):
            if file:
                check_new_file(file, suffix)
        known = read_rows(csv_file, self._row) if csv_file and csv_file.exists() else {}
        command = command_of(self._name, csv_file, markdown)
        for number, case in enumerate(cases, start=1):
            if starting:
                starting(number, len(cases), case.name)
            if case.name not in known or self._repeats(known[case.name]):
                known[case.name] = self._measure(case)
            ordered = [known[each.name] for each in self._cases if each.name in known]
            if csv_file:
                others = [row for name, row in known.items() if name not in {case.name for case in self._cases}]
                write_rows([*ordered, *others], csv_file)  # rows of an earlier list stay
            if markdown:
                self._write_page(ordered, markdown, command)
            yield known[case.name]


def command_of(name: str, csv_file: Path | None, markdown: Path | None) -> str:
    """The command that makes the files of a table."""
    return f"taxel bench {name} --csv {csv_file or 'FILE.csv'} --markdown {markdown}"


def read_rows(file: Path, kind: type[Row]) -> dict[str, Row]:
    """Rows of a file from :func:`write_rows`, by the name of their case; raises `InputError`."""
    types: dict[str, type] = {field.name: str if field.type == "str" else float for field in fields(kind)}
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            read = csv.DictReader(stream)
            return {row["case"]: kind(**{name: types[name](text) for name, text in row.items()}) for row in read}
    except (KeyError, OSError, TypeError, ValueError) as error:
        raise InputError(f"{file} is not allowed: a file of rows that this command wrote is needed.") from error


def write_rows(rows: Iterable[Any], file: Path) -> None:
    """Write rows of one kind with a heading, in full precision; missing numbers are ``nan``."""
    rows = list(rows)
    with replacing(file) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, [field.name for field in fields(rows[0])])
        writer.writeheader()
        writer.writerows(map(asdict, rows))
