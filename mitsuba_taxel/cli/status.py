"""`taxel status`: how far a study is."""

from __future__ import annotations

from pathlib import Path

import click

from .options import debug_option, json_option


@click.command(short_help="How far a study is.")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@json_option
@debug_option
def command(folder: Path, as_json: bool) -> None:
    """Say how far the study in DIR is, while it runs or after."""
    from mitsuba_taxel.studies.store.status import study_status

    from .tables import print_table

    states = study_status(folder)
    if as_json:
        import json

        click.echo(json.dumps({"scenes": [state._asdict() for state in states]}))
        return
    print_table(
        ("scene", "done", "failed", "of", "error", "running", "time left"),
        [
            (
                state.name or folder.name,
                str(state.done),
                str(state.failed),
                str(state.total),
                f"{state.error:.2%}",
                "yes" if state.running else "no",
                "-" if state.seconds_left is None else f"{state.seconds_left:.0f} s",
            )
            for state in states
        ],
    )
