"""`taxel report`: a study as one web page."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import debug_option, json_option, output_option


@click.command(short_help="A study as one self-contained web page.")
@click.argument("folder", type=click.Path(path_type=Path), metavar="DIR")
@output_option("report.html", "The page.")
@json_option
@debug_option
def command(folder: Path, output: Path, as_json: bool) -> None:
    """Write the results in DIR as one web page.

    The page of a study has plots, tables, errors and times, and an interactive view of the deformed pad. The page of a
    study of images has the images, a film, forces, errors and times. The page of a result of `taxel tolerance`, `fit`,
    `optimise`, `compare`, `dataset`, `export` or `calibrate` has its verdict, plots and tables.

    The page is a single file that needs no network and no server.
    """
    from mitsuba_taxel.report.page import write_report

    from ..tables import print_json, progress_bar

    with progress_bar("load steps") as progress:
        left_out = write_report(folder, output, progress)
    if as_json:
        print_json({"file": str(output), "left_out": left_out})
        return
    for line in left_out:
        click.echo(f"Left out: {line}")
    click.echo(f"Results: {output}")
