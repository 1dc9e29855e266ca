"""`taxel render`: the readings of one scene."""

from __future__ import annotations

import math
import time
from pathlib import Path

import click

from ..options import (
    NewFile,
    circuit_option,
    debug_option,
    defines_option,
    derivatives_option,
    json_option,
    points_option,
    seed_option,
    target_error_option,
    time_budget_option,
)

COLOURS = "llvm_ad_rgb"
"""Variant for images, unless another variant is set."""


@click.command(short_help="Readings of one scene, with standard errors.")
@click.argument("scene")
@defines_option
@target_error_option
@points_option
@time_budget_option
@seed_option
@click.option(
    "-o", "--output", type=NewFile(".exr"), metavar="MAP.exr", help="Write an irradiance map, or a camera's image."
)
@click.option("--audit", is_flag=True, help="Also print where the light goes: absorbed, detected, escaped.")
@click.option("--crosstalk", is_flag=True, help="Also print the power of each LED on each phototransistor.")
@click.option("--difference", is_flag=True, help="Also write a camera's image minus that of the unloaded pad.")
@click.option("--explain", is_flag=True, help="Also list the computations that this scene did not need.")
@derivatives_option
@circuit_option
@json_option
@debug_option
def command(
    scene: str,
    defines: dict[str, str],
    target_error: float | None,
    points: int | None,
    time_budget: float | None,
    seed: int,
    output: Path | None,
    audit: bool,
    crosstalk: bool,
    difference: bool,
    explain: bool,
    derivatives: list[str],
    circuit: Path | None,
    as_json: bool,
) -> None:
    """Print the optical power on each phototransistor of SCENE, with its standard error; or write a camera's image."""
    from mitsuba_taxel import sensing
    from mitsuba_taxel.backend import wanted_variant, work_of_processor
    from mitsuba_taxel.base.errors import InputError
    from mitsuba_taxel.sensing.measurement import measured

    from .. import tables

    electronics = tables.circuit_in(circuit)
    began = time.time()
    description = sensing.Scene.from_file(scene, **defines)
    if description.has_camera():
        others = {"--audit": audit, "--crosstalk": crosstalk, "--explain": explain, "--derivatives": derivatives}
        others |= {"--circuit": circuit, "--time-budget": time_budget}
        refused = [name for name in others if others[name]]
        _render_image(description, target_error, points, seed, difference, output, as_json, refused)
        return
    if difference:
        raise InputError("--difference is not allowed for readings, only for the image of a camera.")
    with tables.progress_bar("pads and light"):
        readings, ready = measured(
            description,
            target_error=target_error,
            points=points,
            time_budget=time_budget,
            seed=seed,
            irradiance=output is not None,
            derivatives=derivatives,
        )
    volts = None
    if electronics is not None:
        from mitsuba_taxel.electronics import shown

        volts = shown(electronics, readings)
    matrix = book = lines = None
    if crosstalk:
        with tables.progress_bar("crosstalk"):
            matrix = sensing.crosstalk(ready, points=readings.points, seed=seed)
    if audit:
        number = {} if points is None else {"points": points}
        with tables.progress_bar("energy audit") as progress:
            book = sensing.energy_audit(ready, seed=seed, progress=progress, **number)
    if explain:
        from mitsuba_taxel.sensing.omitted_work import left_out

        lines = left_out(ready, irradiance=output is not None, crosstalk=crosstalk, began=began)
    if output is not None:
        from mitsuba_taxel.sensing.reading.irradiance_file import write_irradiance

        write_irradiance(readings, output)
    if as_json:
        _print_json(readings, volts, matrix, book, lines)
    else:
        _print_tables(readings, ready.scene, volts, matrix, book, lines)
    if not as_json and (remark := work_of_processor(wanted_variant())):
        tables.say(remark)
    if not as_json and (readings.power <= 0).any():
        tables.say(f"taxel check {scene} may say why a taxel is dark.")
    if target_error is not None:
        tables.end_beyond_target(readings.notes)


def _render_image(description, target_error, points, seed, difference, output, as_json, refused) -> None:
    """Write the image of the camera of a scene as EXR and PNG, and print its contents and errors."""
    import os

    import mitsuba as mi

    from mitsuba_taxel.backend import check_backend
    from mitsuba_taxel.base.errors import InputError
    from mitsuba_taxel.sensing.camera import RELATIVE_ERRORS, camera_image
    from mitsuba_taxel.sensing.image_file import write_image
    from mitsuba_taxel.sensing.marker_flow import write_markers

    from .. import tables

    if refused:
        raise InputError(f"{refused[0]} is not allowed for the image of a camera, only for readings: leave it out.")
    if not os.environ.get("MITSUBA_TAXEL_VARIANT"):
        check_backend(COLOURS)
        mi.set_variant(COLOURS)
    with tables.progress_bar("image") as progress:
        image = camera_image(
            description,
            samples=points,
            target_error=target_error,
            seed=seed,
            difference=difference,
            progress=progress,
        )
    file = output or Path(f"{Path(description.name).stem}.exr")
    picture = write_image(image, file)
    table = None
    if image.markers is not None:
        write_markers(image.markers, table := file.with_name(f"{file.stem}_markers.csv"))
    height, width, _ = image.radiance.shape
    errors = image_errors(*(getattr(image, name) for name in RELATIVE_ERRORS))
    if as_json:
        tables.print_json(
            {
                "file": str(file),
                "picture": str(picture),
                "size": [width, height],
                "mean": image.radiance.mean(axis=(0, 1)).tolist(),
                **{name: tables.known(getattr(image, name)) for name in RELATIVE_ERRORS},
                "coat_share": float(image.coat.mean()),
                "samples": image.samples,
                "replicates": image.replicates,
                "seed": image.seed,
                "seconds": image.seconds,
                "notes": list(image.notes),
                **({} if table is None else {"markers": str(table)}),
            }
        )
    else:
        count = f"{image.replicates} replicates of {image.samples} samples"
        tables.say(f"Image of {width} x {height} pixels: {file}, {picture}")
        tables.say(f"The coat fills {image.coat.mean():.1%} of it.")
        tables.say(f"Relative error of a pixel (root mean square): {errors}; light from {count}.")
        if table is not None:
            tables.say(f"Flow of the markers: {table}")
        for note in image.notes:
            tables.say(f"{note[0].upper()}{note[1:]}.")
    if target_error is not None and not image.relative_total_error <= target_error:
        tables.end_beyond_target([f"target error {target_error:g} not reached: {errors}"])


def image_errors(light: float, mechanics: float, total: float) -> str:
    """Relative errors of the pixels of an image in words, such as ``light 4.3%, mechanics 1.2%, total 4.5%``.

    Parameters
    ----------
    light, mechanics, total : float
        Relative errors by the light, by the finite elements, and together; NaN if unknown.

    Returns
    -------
    str
        Part of a sentence.
    """
    from mitsuba_taxel.sensing.reading.wording import budget_rows

    rows = budget_rows({"light": light, "mechanics": mechanics, "total": total})
    return ", ".join(f"{source} {error}" for source, error in rows)


def _print_json(readings, volts, matrix, book, lines) -> None:
    from .. import tables

    answer = readings_as_json(readings, volts) | crosstalk_as_json(matrix) | audit_as_json(book)
    tables.print_json(answer | ({} if lines is None else {"left_out": lines}))


def _print_tables(readings, scene, volts, matrix, book, lines) -> None:
    from mitsuba_taxel.sensing.reading.readings import crosstalk_text, readings_text

    from .. import many_taxels, tables

    width, many = tables.terminal_width(), len(readings.taxel) > many_taxels.MOST_ROWS
    if many:
        print_summary(readings, readings.positions)
    else:
        tables.say(readings_text(readings, width))
    if volts is not None:
        tables.print_volts(readings.taxel, volts)
    if matrix is not None and many:
        tables.say("\nCrosstalk: power on each phototransistor")
        tables.print_summary(readings.taxel, many_taxels.crosstalk_quantities(matrix))
    elif matrix is not None:
        tables.say(f"\n{crosstalk_text(matrix, width)}")
    if book is not None:
        from mitsuba_taxel.sensing.audit import audit_text

        tables.say(f"\n{audit_text(book, width)}")
    if lines is not None:
        tables.print_left_out(lines)


def print_summary(readings, positions) -> None:
    """Print readings of many taxels: the answer, least, mean and most, a map, and how they were obtained.

    Parameters
    ----------
    readings : Readings
        Readings of T taxels.
    positions : (T, 2) ndarray
        Positions of the taxels along x and y, in mm.
    """
    from mitsuba_taxel.sensing.reading.readings import origin_lines, readings_answer

    from .. import many_taxels, tables

    tables.say(f"{readings_answer(readings)}\n")
    tables.print_summary(readings.taxel, many_taxels.reading_quantities(readings))
    if dark := int((readings.power <= 0).sum()):
        tables.say(f"Taxels without light: {dark} of {len(readings.taxel)}")
    tables.say(many_taxels.full_table(len(readings.taxel), many_taxels.WITH_JSON))
    for line in many_taxels.map_lines(readings.power, positions, "W"):
        print(line)
    for line in origin_lines(readings):
        tables.say(line)
    if readings.derivatives is not None:
        tables.say(f"\nDerivatives of the readings ({readings.derivatives.method})")
        tables.print_summary(readings.taxel, many_taxels.derivative_quantities(readings.derivatives))


def readings_as_json(readings, volts=None) -> dict[str, object]:
    """The object that ``--json`` prints."""
    from ..tables import known

    columns = {
        "taxel": readings.taxel,
        "power_W": readings.power,
        "standard_error_W": readings.standard_error,
        "mechanics_error_W": readings.mechanics_error,
        "geometry_error_W": readings.geometry_error,
        "total_error_W": readings.total_error,
    }
    if readings.photocurrent is not None:
        columns["photocurrent_A"] = readings.photocurrent
    if volts is not None:
        columns |= volts.columns
    rows = zip(*([known(value) for value in column.tolist()] for column in columns.values()), strict=True)
    return (
        {
            "readings": [dict(zip(columns, row, strict=True)) for row in rows],
            "error_budget": {source: known(fraction) for source, fraction in readings.error_budget.items()},
            "pads": {
                name: dict(zip(("value", "error"), map(known, estimate), strict=True))
                for name, estimate in readings.pads.items()
            },
            "mesh_size_mm": readings.mesh_size,
            "seconds": {stage: float(seconds) for stage, seconds in readings.seconds.items()},
            "parameters": dict(readings.parameters),
            "notes": readings.notes,
        }
        | derivatives_as_json(readings.derivatives)
        | volts_as_json(volts)
    )


def derivatives_as_json(derivatives) -> dict[str, object]:
    """The entry that ``--derivatives`` adds to the output of ``--json``."""
    if derivatives is None:
        return {}
    from ..tables import known

    return {"derivatives": [{name: known(value) for name, value in row.items()} for row in derivatives.rows()]}


def volts_as_json(volts) -> dict[str, object]:
    """The entry that ``--circuit`` adds to the output of ``--json``, besides columns of the readings."""
    if volts is None:
        return {}
    step = {"volts_per_count": volts.step}
    derivatives = derivatives_as_json(volts.derivatives).get("derivatives")
    return step if derivatives is None else {**step, "derivatives_in_volts": derivatives}


def crosstalk_as_json(matrix) -> dict[str, object]:
    """The entry that ``--crosstalk`` adds to the output of ``--json``: rows are LEDs, columns phototransistors."""
    if matrix is None:
        return {}
    power, error = matrix.power.tolist(), matrix.standard_error.tolist()
    found = {"power_W": power, "standard_error_W": error, "points": matrix.points}
    if matrix.deviation is not None:
        error = matrix.mechanics_error.tolist()
        found["mechanics_error_W"] = None if math.isnan(error[0][0]) else error
    return {"crosstalk": found}


def audit_as_json(audit) -> dict[str, object]:
    """The entry that ``--audit`` adds to the output of ``--json``: fractions of the emitted power by the places where
    the light is absorbed.
    """
    if audit is None:
        return {}
    rows = zip(audit.places, audit.share.tolist(), audit.standard_error.tolist(), strict=True)
    keys = ("place", "share", "standard_error")
    shares = [dict(zip(keys, row, strict=True)) for row in rows]
    return {"audit": {"shares": shares, "total": audit.total, "points": audit.points}}
