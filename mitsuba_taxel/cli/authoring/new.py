"""`taxel new`: commented templates."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import debug_option


@click.command(short_help="A commented template of a scene, study, table of steps, circuit or part.")
@click.argument("kind", type=click.Choice(["scene", "touch", "study", "steps", "circuit", "part"]))
@click.argument("file", type=click.Path(path_type=Path), required=False)
@click.option(
    "--part",
    metavar="PART",
    help="For a circuit: photo-reflector whose datasheet gives the numbers, a name of the catalogue or a TOML file.",
)
@debug_option
def command(kind: str, file: Path | None, part: str | None) -> None:
    """Write a commented template: scene.xml, touch.xml (a ball on a pad), study.toml, steps.csv, circuit.toml or
    part.toml, or FILE.

    Existing files are not overwritten.
    """
    from mitsuba_taxel.studies.plan.templates import SUFFIXES, write_template

    file = file or Path(f"{kind}{SUFFIXES[kind]}")
    write_template(kind, file, part)
    click.echo(f"Written: {file}")
