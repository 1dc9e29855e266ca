"""`taxel sweep`: a scene over ranges or lists of its parameters."""

from __future__ import annotations

from pathlib import Path

import click

from .options import (
    assignments,
    debug_option,
    defines_option,
    folder_option,
    json_option,
    points_option,
    seed_option,
    target_error_option,
)


@click.command(short_help="Readings over ranges or lists of parameters.")
@click.argument("scene")
@click.option(
    "--vary", multiple=True, required=True, metavar="NAME=VALUES", callback=assignments,
    help="start:stop:step (stop included) or a,b,c; several make a product.",
)  # fmt: skip
@defines_option
@target_error_option
@points_option
@seed_option
@folder_option
@json_option
@debug_option
def command(
    scene: str,
    vary: dict[str, str],
    defines: dict[str, str],
    target_error: float | None,
    points: int | None,
    seed: int,
    folder: Path,
    as_json: bool,
) -> None:
    """Read SCENE at every value of its varied parameters.

    Tables, meshes, a plot and a summary go to DIR, which must be empty or new.
    """
    from mitsuba_taxel.studies import stage_totals, sweep

    from .tables import print_table, progress_bar, stage_line

    with progress_bar("readings") as progress:
        study = sweep(
            scene,
            vary,
            defines,
            target_error=target_error,
            points=points,
            seed=seed,
            output=folder,
            progress=progress,
        )
    seconds = stage_totals(study)
    rows = _sensitivities(study)
    if as_json:
        import json

        click.echo(json.dumps({"output": str(folder), "sensitivity": rows, "seconds": seconds}))
        return
    if rows:
        names = list(rows[0])
        print_table(names, ([_cell(row[name]) for name in names] for row in rows))
    points, replicates = study.attrs["points"], study.sizes["replicate"]
    print(f"{study.power.size} readings, each from {replicates} randomisations of {points} points.")
    for note in study.attrs["notes"].splitlines():
        print(note)
    print(stage_line(seconds))
    print(f"Results: {folder}")


def _sensitivities(study) -> list[dict[str, object]]:
    from mitsuba_taxel.characterise import sensitivity_table

    return sensitivity_table(study).to_dict("records")


def _cell(value: object) -> str:
    return f"{value:.3e}" if isinstance(value, float) else str(value)
