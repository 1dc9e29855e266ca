"""`taxel validate`: comparison of simulated with measured sensors."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import debug_option, folder_option


@click.command(short_help="Simulated sensors compared with measured ones.")
@folder_option
@click.option(
    "--docs",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for validation.md.  [default: that of results]",
)
@debug_option
def command(folder: Path, docs: Path | None) -> None:
    """Compare simulated sensors with measured ones, and write the page validation.md.

    Parts of the comparison that are complete in DIR are not computed again."""
    from mitsuba_taxel.evidence.measured.validation import write_validation
    from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies

    store = PaperStudies(folder, lambda name: click.echo(name, err=True))
    said = f"taxel validate -o DIR{f' --docs {docs}' if docs else ''}"
    click.echo(f"Page: {write_validation(store, docs or folder, said)}")
