"""What a command prints of a result, kept beside the result, so that its page shows the same."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mitsuba_taxel.base.files.atomic import write_text

FILE = "printed.json"
"""Name of the file in a folder of results."""
WARNING = "warning: "
"""Beginning of lines that a command prints on stderr."""


class PrintedTable(NamedTuple):
    """A table in words: its title, which may be empty, headings and rows."""

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
        Without a colon.
    headings : sequence of str
        Of the columns; the first may be "force".
    rows : sequence of sequence of str
        A cell for each heading.

    Returns
    -------
    PrintedTable
        Without the column of the force if the title names it.
    """
    forces = {row[0] for row in rows} if headings and headings[0] == "force" else set()
    first = 1 if len(forces) == 1 else 0
    named = f"{title}{f', {forces.pop()}' if first else ''}:"
    return PrintedTable(named, list(headings[first:]), [list(row[first:]) for row in rows])


def as_json(printed: Printed) -> str:
    """Blocks as the text of a file.

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
    """The reverse of :func:`as_json`.

    Parameters
    ----------
    text : str
        As :func:`as_json` gives it.

    Returns
    -------
    Printed
        Paragraphs and tables.

    Raises
    ------
    ValueError, TypeError
        if it is no such text.
    """
    blocks = json.loads(text)
    if not isinstance(blocks, list):
        raise TypeError("a list is needed")
    return [_block(block) for block in blocks]


def _block(block: Any) -> PrintedTable | str:
    """A line or a table; raises TypeError for anything else, as the text may be somebody else's."""

    def are_words(row: Any) -> bool:
        return isinstance(row, list) and all(isinstance(word, str) for word in row)

    if isinstance(block, str):
        return block
    made = PrintedTable(**block)
    if not (isinstance(made.title, str) and are_words(made.headings)):
        raise TypeError("a table needs a title and headings")
    if not (isinstance(made.rows, list) and all(are_words(row) for row in made.rows)):
        raise TypeError("a table needs rows of words")
    return made


def write_printed(printed: Printed, folder: Path) -> None:
    """Write what is printed of the results in a folder.

    Parameters
    ----------
    printed : Printed
        Paragraphs and tables.
    folder : Path
        Of results.

    Raises
    ------
    WriteError
        if the file cannot be written.
    """
    write_text(folder / FILE, as_json(printed))


def read_printed(folder: Path) -> Printed | None:
    """What was printed of the results in a folder; None if there is no such file, or one of another version.

    Parameters
    ----------
    folder : Path
        Of results.

    Returns
    -------
    Printed or None
        Paragraphs and tables.
    """
    try:
        return from_json((folder / FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError, TypeError):
        return None
