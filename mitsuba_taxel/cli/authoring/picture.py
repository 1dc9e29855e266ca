"""`taxel picture`: the sensor itself, cut open."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from ..options import debug_option, defines_option, json_option


class _CutPosition(click.ParamType):
    """Position of the cut: ``middle``, ``none``, or y in mm, also written as y=0.5."""

    name = "cut"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | str:
        text = str(value).strip().removeprefix("y=")
        if text in ("middle", "none"):
            return text
        try:
            offset = float(text)
        except ValueError:
            offset = math.nan
        if not math.isfinite(offset):
            self.fail(f"{value!r} is not allowed: y in mm, middle or none is needed.", param, ctx)
        return offset


@click.command(short_help="A picture of the sensor, cut open.")
@click.argument("scene")
@defines_option
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), default=Path("picture.png"), show_default=True, metavar="FILE",
    help="Picture, as PNG or, in linear colours, as EXR.",
)  # fmt: skip
@click.option(
    "--width", type=click.IntRange(16, 8192), default=1600, show_default=True,
    help="Width in pixels; the aspect ratio is 16:10.",
)  # fmt: skip
@click.option(
    "--samples", type=click.IntRange(1, 65536), default=64, show_default=True,
    help="Samples per pixel, rounded up to a multiple of 16; four times as many halve the noise.",
)  # fmt: skip
@click.option(
    "--cut", type=_CutPosition(), default="middle", show_default=True, metavar="Y",
    help="Position of the cut along y in mm; middle (through the middle row of cells) or none (no cut).",
)  # fmt: skip
@click.option(
    "--magnify", type=click.FloatRange(min=0, max=1000), default=1.0, show_default=True, metavar="FACTOR",
    help="Factor on displacements of the pad, stated in the picture.",
)  # fmt: skip
@json_option
@debug_option
def command(
    scene: str,
    defines: dict[str, str],
    output: Path,
    width: int,
    samples: int,
    cut: float | str,
    magnify: float,
    as_json: bool,
) -> None:
    """Draw the sensor of SCENE: deformed pad, photo-reflectors and board, seen from -y and from above.

    Everything in front of the cut except the photo-reflectors is removed. LEDs glow in red, for near infrared.
    An indenter is drawn translucent, and its contact pressure as a colour.
    """
    from mitsuba_taxel.report.picture.drawing import (
        PICTURES,
        labelled,
        most_pressure,
        render_parts,
        with_scale,
        write_picture,
    )
    from mitsuba_taxel.report.picture.sensor_parts import shown_parts
    from mitsuba_taxel.sensing import Scene
    from mitsuba_taxel.studies.plan.files import check_new_file

    from ..tables import print_json, progress_bar

    check_new_file(output, *PICTURES)
    description = Scene.from_file(scene, **defines)
    with progress_bar("pads"):
        solids, offset = shown_parts(description.load(), cut, magnify)
    with progress_bar("picture") as progress:
        pixels = render_parts(solids, width=width, samples=samples, progress=progress)
    if magnify != 1:
        pixels = labelled(pixels, f"deformation shown {magnify:g} times")
    if most := most_pressure(solids):
        pixels = with_scale(pixels, most)
    write_picture(pixels, output)
    height = len(pixels)
    if as_json:
        about = {"width": width, "height": height, "samples": samples, "cut": offset, "magnify": magnify}
        print_json({**about, "files": [str(output)]})
        return
    where = "not cut" if offset is None else f"cut at y = {offset:g} mm"
    shown = "" if magnify == 1 else f", deformation shown {magnify:g} times"
    click.echo(f"{width} x {height} pixels of at least {samples} samples, {where}{shown}.")
    click.echo(f"Results: {output}")
