"""HTML elements of the page; all text from a study is escaped."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def section(name: str, title: str, *blocks: str) -> str:
    """HTML of a section with an anchor for the table of contents."""
    return f'<section id="{name}" aria-labelledby="{name}-title"><h2 id="{name}-title">{escape(title)}</h2>' + (
        "\n".join(blocks) + "</section>"
    )


def paragraph(text: str, kind: str = "") -> str:
    """HTML of a paragraph of plain text; ``kind`` is a class of the style sheet."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def bullets(lines: Sequence[str]) -> str:
    """HTML of a bulleted list; empty text if there are no lines."""
    return f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>" if lines else ""


def table(caption: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """HTML of a table that scrolls if it is wider than the screen."""
    head = "".join(f'<th scope="col">{escape(heading)}</th>' for heading in headings)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(caption)}"><table>'
        f"<caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def folded(title: str, *blocks: str) -> str:
    """HTML of content that is shown when its title is clicked."""
    return f"<details><summary>{escape(title)}</summary>{''.join(blocks)}</details>"


class PlotFunction(Protocol):
    """Function that draws a figure; on request, a narrow figure for a phone."""

    def __call__(self, *, narrow: bool = False) -> Figure: ...


def plot(draw: PlotFunction, words: str, caption: str) -> str:
    """HTML of a plot as SVG, with a narrow version for phones; ``words`` are the alternative text."""
    wide, narrow = (_svg(draw(narrow=narrow)) for narrow in (False, True))
    return (
        f'<figure><picture><source media="(max-width: 40rem)" srcset="{narrow}">'
        f'<img class="plot" src="{wide}" alt="{escape(words)}"></picture>'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _svg(figure: Figure) -> str:
    import matplotlib

    picture = BytesIO()
    with matplotlib.rc_context({"svg.fonttype": "path", "svg.hashsalt": "page", "savefig.transparent": True}):
        figure.savefig(picture, format="svg")
    return f"data:image/svg+xml;base64,{base64.b64encode(picture.getvalue()).decode('ascii')}"
