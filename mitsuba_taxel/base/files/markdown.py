"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence


def markdown_table(headings: Sequence[str], rows: Iterable[Sequence[str]], left: Collection[str] | None = None) -> str:
    """Format headings and rows as a table in Markdown.

    Parameters
    ----------
    headings : sequence of str
        Headings of the columns.
    rows : iterable of sequence of str
        A cell for each heading.
    left : Collection[str], optional
        Headings of the columns that are aligned left, by default the first; the others are aligned right.

    Returns
    -------
    str
        Lines, without a line feed at the end.
    """
    left_aligned = headings[:1] if left is None else left
    alignment = [":--" if heading in left_aligned else "--:" for heading in headings]
    lines = [headings, alignment, *([cell.replace("|", r"\|") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
