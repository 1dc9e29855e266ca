"""`taxel reproduce`: the paper's figures and tables, recomputed."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path

import click

from ..options import debug_option, folder_option


@click.command(short_help="The paper's figures and tables, recomputed.")
@folder_option
@click.option(
    "--only", metavar="PARTS",
    help="Comma-separated list of optics (fig4, fig5, fig6, peak), nominal, roofs, beyond, analog, variations, "
    "optimum, and mould (printed moulds, one factor at a time) and mould_rest (all other combinations, many hours), "
    "which are computed only if they are listed.",
)  # fmt: skip
@click.option(
    "--docs", type=click.Path(path_type=Path), metavar="DIR", help="Folder for paper.md.  [default: that of results]"
)
@click.option(
    "--workers", type=click.IntRange(min=1), metavar="N",
    help="Worker processes; shapes and their load paths are distributed over them.",
)  # fmt: skip
@debug_option
def command(folder: Path, only: str | None, docs: Path | None, workers: int | None) -> None:
    """Recompute the figures and tables of the paper, and write the pages paper.md, optimum.md and mould.md.

    Parts that are complete in DIR are not computed again. The pages contain all complete parts.
    """
    from mitsuba_taxel.evidence.paper.page.page import write_pages
    from mitsuba_taxel.evidence.paper.parts import chosen, complete, compute
    from mitsuba_taxel.sensing.reading.wording import stage_line

    start = time.monotonic()
    announce = partial(_announce, start)
    seconds = compute(folder, chosen(only), workers, announce)
    took = time.monotonic() - start
    announce("page")
    pages = write_pages(complete(folder), docs or folder, _command(docs))
    if seconds:
        click.echo(f"{stage_line(seconds)}, summed over processes; {took:.2f} by the clock")
    for page in pages:
        click.echo(f"Page: {page}")


def _announce(start: float, name: str) -> None:
    click.echo(f"{time.monotonic() - start:7.0f} s  {name}", err=True)


def _command(docs: Path | None) -> str:
    return f"taxel reproduce -o DIR{f' --docs {docs}' if docs else ''}"
