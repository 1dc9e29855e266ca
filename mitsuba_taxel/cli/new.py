"""`taxel new`: files to start from."""

from __future__ import annotations

from pathlib import Path

import click

from .options import debug_option


@click.command(short_help="A commented scene, study or table of steps to start from.")
@click.argument("kind", type=click.Choice(["scene", "study", "steps"]))
@click.argument("file", type=click.Path(path_type=Path), required=False)
@debug_option
def command(kind: str, file: Path | None) -> None:
    """Write a commented file to start from: scene.xml, study.toml or steps.csv, or FILE.

    A file that is there already is left as it is, and refused.
    """
    from mitsuba_taxel.studies.plan.templates import SUFFIXES, write_template

    file = file or Path(f"{kind}{SUFFIXES[kind]}")
    write_template(kind, file)
    click.echo(f"Written: {file}")
