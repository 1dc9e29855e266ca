"""`taxel deform`: the deformed pad of a scene, without light."""

from __future__ import annotations

from pathlib import Path

import click

from .options import debug_option, defines_option, folder_option, json_option


@click.command(short_help="Deformed pads alone, as PLY.")
@click.argument("scene")
@defines_option
@folder_option
@json_option
@debug_option
def command(scene: str, defines: dict[str, str], folder: Path, as_json: bool) -> None:
    """Write the deformed pads of SCENE to DIR as PLY, with region and cell of each face."""
    from mitsuba_taxel.studies import deform

    from .tables import print_table, progress_bar

    with progress_bar("pads"):
        rows = deform(scene, defines, folder)
    if as_json:
        import json

        click.echo(json.dumps({"pads": rows}))
    else:
        print_table(list(rows[0]), ([str(value) for value in row.values()] for row in rows))
