"""`taxel rays`: a picture of light paths in a taxel's cell."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import NewFile, debug_option, defines_option, json_option, seed_option


@click.command(short_help="A picture of light paths in one cell.")
@click.argument("scene")
@defines_option
@click.option("--taxel", type=click.IntRange(min=1), default=1, show_default=True, help="Number of the taxel.")
@click.option(
    "--count", type=click.IntRange(1, 100_000), default=200, show_default=True,
    help="Number of paths; up to half of them reach the phototransistor.",
)  # fmt: skip
@seed_option
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), default=Path("rays.png"), show_default=True, metavar="FILE",
    help="Picture, as PNG, SVG or PDF.",
)  # fmt: skip
@click.option("--vtk", type=NewFile(".vtk"), metavar="FILE.vtk", help="Also write the paths as polylines.")
@json_option
@debug_option
def command(
    scene: str,
    defines: dict[str, str],
    taxel: int,
    count: int,
    seed: int,
    output: Path,
    vtk: Path | None,
    as_json: bool,
) -> None:
    """Draw light paths from the LED of one taxel of SCENE: some that reach its phototransistor, and others."""
    from mitsuba_taxel.report.picture.rays import PICTURES, plot_paths, write_vtk
    from mitsuba_taxel.sensing import Scene, sample_paths
    from mitsuba_taxel.studies.plan.files import check_new_file

    from ..tables import print_json, progress_bar

    check_new_file(output, *PICTURES)
    description = Scene.from_file(scene, **defines)
    with progress_bar("pads"):
        live = description.load()
    with progress_bar("paths that reach") as progress:
        paths = sample_paths(live, taxel, count=count, seed=seed, progress=progress)
    plot_paths(live, paths, description.name, output)
    files = [output] if vtk is None else [output, vtk]
    if vtk is not None:
        write_vtk(paths, vtk)
    shown = len(paths.vertices)
    reached = int(paths.reached.sum())
    if as_json:
        counts = {"paths": shown, "reached": reached, "drawn": paths.drawn, "arrived": paths.arrived}
        print_json({"taxel": taxel, **counts, "files": [str(file) for file in files]})
        return
    click.echo(f"{shown} paths shown, {reached} of them reach phototransistor {taxel};", nl=False)
    click.echo(f" of {paths.drawn} drawn, {paths.arrived} do.")
    click.echo(f"Results: {', '.join(map(str, files))}")
