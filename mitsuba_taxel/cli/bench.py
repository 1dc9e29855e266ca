"""`taxel bench`: tables that say how the program does, made anew."""

from __future__ import annotations

from pathlib import Path

import click

from .options import debug_option


@click.group(short_help="Tables of how the program does at the extremes.")
@debug_option
def command() -> None:
    """Make a table of how the program does at the extremes anew."""


@command.command("stability", short_help="Pads, materials and loads at the extremes of the mechanics.")
@click.option("--only", metavar="PATTERN", help="Part of the names of the rows wanted; * and ? stand for anything.")
@click.option("--csv", type=click.Path(path_type=Path), metavar="FILE", help="Also write the rows, all digits.")
@click.option("--markdown", type=click.Path(path_type=Path), metavar="FILE", help="Also write a page with the table.")
@debug_option
def stability_command(only: str | None, csv: Path | None, markdown: Path | None) -> None:
    """Load pads at the extremes of the mechanics and say what became of each.

    Rows are measured one by one, each in a process of its own; files hold those measured so far.
    """
    from mitsuba_taxel.bench.row import HEADINGS, Row, cells
    from mitsuba_taxel.bench.stability import check, stability

    from .tables import print_text_table

    def starting(number: int, count: int, name: str) -> None:
        click.echo(f"{number}/{count} {name}: ", nl=False, err=True)

    rows: list[Row] = []
    try:
        for row in stability(only, csv, markdown, starting):
            rows.append(row)
            click.echo(cells(row)[1], err=True)
    finally:
        if rows:
            print_text_table(list(HEADINGS.values()), map(cells, rows))
    check(rows)
