"""`taxel status`: progress of a study."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import debug_option, json_option


@click.command(short_help="Progress of a study.")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@json_option
@debug_option
def command(folder: Path, as_json: bool) -> None:
    """Show the progress of the study in DIR, while it runs or afterwards."""
    from mitsuba_taxel.base.units import in_percent
    from mitsuba_taxel.studies.store.status import study_status

    from ..tables import known, print_json, print_table, say

    states = study_status(folder)
    if as_json:
        print_json({"scenes": [state._asdict() | {"error": known(state.error)} for state in states]})
        return
    done, failed, total = (sum(getattr(state, name) for state in states) for name in ("done", "failed", "total"))
    say(f"{done} of {total} scenes are computed, {failed} failed.\n")
    print_table(
        ("scene", "done", "failed", "of", "error", "running", "time left"),
        [
            (
                state.name or folder.name,
                str(state.done),
                str(state.failed),
                str(state.total),
                in_percent(state.error),
                "yes" if state.running else "no",
                "-" if state.seconds_left is None else "{:.0f} to {:.0f} s".format(*state.seconds_left),
            )
            for state in states
        ],
    )
