"""Tables as plain text, in aligned columns."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence

UNLIMITED = 10_000
"""A width in characters that no line exceeds, so that lines are not folded."""


def text_table(headings: Sequence[str], rows: Iterable[Sequence[str]], width: int | None = None) -> str:
    """A table as text, with the first column aligned left and the others aligned right.

    Parameters
    ----------
    headings : sequence of str
        Headings of the columns.
    rows : iterable of sequence of str
        A cell for each heading.
    width : int, optional
        Largest width of a line in characters, above which cells are folded; by default cells are not folded.

    Returns
    -------
    str
        Lines, without a line feed at the end.
    """
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for number, heading in enumerate(headings):
        table.add_column(heading, justify="left" if number == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    text = io.StringIO()
    console = Console(file=text, highlight=False, markup=False, color_system=None, width=width or UNLIMITED)
    if console.measure(table).maximum > console.width:
        for column in table.columns:
            column.no_wrap, column.overflow = False, "fold"
    console.print(table)
    return text.getvalue().removesuffix("\n")
