"""`taxel render`: the readings of one scene."""

from __future__ import annotations

from pathlib import Path

import click

from .options import (
    debug_option,
    defines_option,
    json_option,
    points_option,
    seed_option,
    target_error_option,
)


@click.command(short_help="Readings of one scene, with standard errors.")
@click.argument("scene")
@defines_option
@target_error_option
@points_option
@seed_option
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), metavar="MAP.exr", help="Write an irradiance map."
)
@json_option
@debug_option
def command(
    scene: str,
    defines: dict[str, str],
    target_error: float | None,
    points: int | None,
    seed: int,
    output: Path | None,
    as_json: bool,
) -> None:
    """Print the optical power on each phototransistor of SCENE, with its standard error."""
    from mitsuba_taxel.optics import Scene, measure
    from mitsuba_taxel.studies.files import check_new_file

    from .tables import print_readings, progress_bar

    if output is not None:
        check_new_file(output, ".exr")
    with progress_bar("pads and light"):
        readings = measure(
            Scene.from_file(scene, **defines),
            target_error=target_error,
            points=points,
            seed=seed,
            irradiance=output is not None,
        )
    if output is not None:
        from mitsuba_taxel.report.maps import write_irradiance

        write_irradiance(output, readings)
    if as_json:
        import json

        click.echo(json.dumps(readings_as_json(readings)))
    else:
        print_readings(readings)


def readings_as_json(readings) -> dict[str, object]:
    """The object that ``--json`` prints."""
    return {
        "readings": [
            {"taxel": int(taxel), "power_W": float(power), "standard_error_W": float(error)}
            for taxel, power, error in zip(
                readings.taxel, readings.power, readings.standard_error, strict=True
            )
        ],
        "seconds": {stage: float(seconds) for stage, seconds in readings.seconds.items()},
        "parameters": dict(readings.parameters),
    }
