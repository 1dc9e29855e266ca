"""The printed output of a command, stored with its result, so that the page of the result shows the same."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mitsuba_taxel.base.files.atomic import write_text

FILE = "printed.json"
"""Name of the file in a folder of results."""
WARNING = "warning: "
"""Prefix of lines that a command prints on stderr."""


class PrintedTable(NamedTuple):
    """A table as text: its title, which may be empty, headings and rows."""

    title: str
    headings: list[str]
    rows: list[list[str]]


Printed = list[PrintedTable | str]
"""Tables and lines in the order in which they are printed."""


def figures_table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> PrintedTable:
    """A table of figures of merit, whose title names the force if there is only one.

    Parameters
    ----------
    title : str
        Title without a colon.
    headings : sequence of str
        Headings of the columns; the first may be "force".
    rows : sequence of sequence of str
        A cell for each heading.

    Returns
    -------
    PrintedTable
        Table without the column of the force if the title contains the force.
    """
    forces = {row[0] for row in rows} if headings and headings[0] == "force" else set()
    first = 1 if len(forces) == 1 else 0
    named = f"{title}{f', {forces.pop()}' if first else ''}:"
    return PrintedTable(named, list(headings[first:]), [list(row[first:]) for row in rows])


def as_json(printed: Printed) -> str:
    """Convert printed output, paragraphs and tables, to JSON.

    Parameters
    ----------
    printed : Printed
        Paragraphs and tables.

    Returns
    -------
    str
        JSON.
    """
    return json.dumps([block if isinstance(block, str) else block._asdict() for block in printed])


def from_json(text: str) -> Printed:
    """Convert JSON back to printed output: the inverse of :func:`as_json`.

    Parameters
    ----------
    text : str
        JSON of :func:`as_json`.

    Returns
    -------
    Printed
        Paragraphs and tables.

    Raises
    ------
    ValueError, TypeError
        if the text is not a result of :func:`as_json`.
    """
    blocks = json.loads(text)
    if not isinstance(blocks, list):
        raise TypeError("a list is needed")
    return [_block(block) for block in blocks]


def _block(block: Any) -> PrintedTable | str:
    """A line or a table; raises TypeError for anything else, as the file may be from another program."""

    def are_words(row: Any) -> bool:
        return isinstance(row, list) and all(isinstance(word, str) for word in row)

    if isinstance(block, str):
        return block
    table = PrintedTable(**block)
    if not (isinstance(table.title, str) and are_words(table.headings)):
        raise TypeError("a table needs a title and headings")
    if not (isinstance(table.rows, list) and all(are_words(row) for row in table.rows)):
        raise TypeError("a table needs rows of words")
    return table


def write_printed(printed: Printed, folder: Path) -> None:
    """Write the printed output of a command into a folder of results.

    Parameters
    ----------
    printed : Printed
        Paragraphs and tables.
    folder : Path
        Folder of results.

    Raises
    ------
    WriteError
        if the file cannot be written.
    """
    write_text(folder / FILE, as_json(printed))


def read_printed(folder: Path) -> Printed | None:
    """Read the printed output of the command that wrote a folder of results.

    Parameters
    ----------
    folder : Path
        Folder of results.

    Returns
    -------
    Printed or None
        Paragraphs and tables; None without the file, or if another version wrote it.
    """
    try:
        return from_json((folder / FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError, TypeError):
        return None
