"""`taxel deform`: the deformed pad of a scene, without light."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import debug_option, defines_option, folder_option, json_option


@click.command(short_help="Deformed pads alone, as PLY and VTU.")
@click.argument("scene")
@defines_option
@folder_option
@click.option(
    "--steps", type=click.Path(path_type=Path), metavar="STEPS.csv",
    help="Load steps, one per row; columns are parameters.",
)  # fmt: skip
@click.option("--vtu", is_flag=True, help="Also write displacement, stress and strain for ParaView.")
@json_option
@debug_option
def command(scene: str, defines: dict[str, str], folder: Path, steps: Path | None, vtu: bool, as_json: bool) -> None:
    """Write the deformed pads of SCENE to DIR as PLY, with region and cell of each face."""
    from mitsuba_taxel.studies import deform, read_steps
    from mitsuba_taxel.studies.plan.batch import parameters_in

    from ..tables import print_json, print_pads, progress_bar

    path = [{}] if steps is None else read_steps(steps, known=parameters_in(scene))
    with progress_bar("load steps") as progress:
        rows = deform(scene, defines, folder, path, vtu=vtu, progress=progress)
    if as_json:
        print_json({"pads": rows})
    else:
        print_pads(rows)
