"""`taxel export`: a study, or the contact of a pad, as a fast model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..options import Fraction, NewFile, debug_option, defines_option, json_option


@click.command(short_help="A study, or the contact of a pad, as a fast model for simulators.")
@click.argument("source", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", type=NewFile(".onnx", ".npz", ".py"), metavar="FILE", show_default="model.onnx, or contact.npz",
    help="File for the model.",
)  # fmt: skip
@click.option("--contact", is_flag=True, help="Model a scene's pad under bodies of any shape, instead of a study.")
@click.option(
    "--depth", type=float, metavar="MM", help="With --contact: largest depth of a body below the top of the pad, in mm."
)
@click.option(
    "--error", type=Fraction(), metavar="SHARE", show_default="1%",
    help="With --contact: largest error of readings on test bodies (root mean square, relative to the largest change). "
    "If it is not reached, the exit code is 3.",
)  # fmt: skip
@click.option(
    "--spacing", type=float, metavar="MM", show_default="1/15 of the longer side",
    help="With --contact: grid spacing of the depth map, in mm.",
)  # fmt: skip
@click.option(
    "--friction", is_flag=True,
    help="With --contact: the .npz file also has tangential compliances, for `FrictionPads`; the linear part takes "
    "about four times as long.",
)  # fmt: skip
@defines_option
@json_option
@debug_option
@click.pass_context
def command(
    ctx: click.Context,
    source: Path,
    output: Path | None,
    contact: bool,
    depth: float | None,
    error: float | None,
    spacing: float | None,
    friction: bool,
    defines: dict[str, str],
    as_json: bool,
) -> None:
    """Fit a model to the readings of the study in DIR, as a function of its varied parameters, and write it as ONNX.

    The model is a polynomial, cross-validated on whole load paths. For a study with a circuit it also computes voltages
    and counts. Its output `inside` is false for inputs outside the ranges of the study. The file states units and
    errors.

    With --contact, the argument is a scene instead. The model then describes its pad under bodies of any shape. The
    input is a map of the depth of a body below the top of the pad. The outputs are readings, force, centre of pressure
    and area of contact. The model is trained on balls and rods until its error is small enough; the same command
    resumes an interrupted run. `mitsuba_taxel.surrogates.read_contact_model` reads an .npz file. An .onnx file is read
    by any ONNX runtime. A .py file needs JAX alone and has derivatives. An .npz file in place of the scene is
    converted, and nothing is computed again.
    """
    given: dict[str, Any] = {"--depth": depth, "--error": error, "--spacing": spacing, "--friction": friction or None}
    given["-D"] = defines or None
    if contact and source.suffix == ".npz":
        _convert_contact(ctx, source, output, given, as_json)
        return
    if contact:
        if depth is None:
            raise click.UsageError("--contact needs --depth, the largest depth in mm.", ctx)
        if friction and output is not None and output.suffix != ".npz":
            raise click.UsageError(f"--friction needs an .npz file: models in {output.suffix} have no friction.", ctx)
        _export_contact(ctx, source, output, depth, error or 0.01, spacing, friction, defines, as_json)
        return
    for name, value in given.items():
        if value is not None:
            raise click.UsageError(f"{name} needs --contact.", ctx)
    if output is not None and output.suffix != ".onnx":
        raise click.UsageError(f"{output.suffix} needs --contact: the model of a study is an .onnx file.", ctx)
    _export_study(source, output or Path("model.onnx"), as_json)


def _export_study(folder: Path, output: Path, as_json: bool) -> None:
    from mitsuba_taxel import open_study
    from mitsuba_taxel.surrogates import export
    from mitsuba_taxel.surrogates.wording import printed_model

    from ..tables import print_json, print_result, say

    files, notes = export(open_study(folder), output)
    if as_json:
        about = {"inputs": files.names, "units": files.units, "low": files.low.tolist(), "high": files.high.tolist()}
        error = {"rms": files.rms, "worst": files.worst, "tested": files.tested}
        print_json({**about, "error": error, "notes": notes, "file": str(output)})
        return
    print_result(printed_model(files, notes))
    say(f"Results: {output}")


def _convert_contact(
    ctx: click.Context, source: Path, output: Path | None, given: dict[str, Any], as_json: bool
) -> None:
    from mitsuba_taxel.surrogates import read_contact_model, write_contact_model
    from mitsuba_taxel.surrogates.contact_export import origin_of

    from ..tables import print_json, say

    for name, value in given.items():
        if value is not None:
            raise click.UsageError(f"{name} needs a scene: {source} is a model already.", ctx)
    if output is None:
        raise click.UsageError("-o is needed: the name of the other form, which ends in .onnx or .py.", ctx)
    write_contact_model(read_contact_model(source), output, origin_of(source))
    print_json({"file": str(output)}) if as_json else say(f"Results: {output}")


def _export_contact(
    ctx: click.Context,
    scene: Path,
    output: Path | None,
    depth: float,
    error: float,
    spacing: float | None,
    friction: bool,
    defines: dict[str, str],
    as_json: bool,
) -> None:
    from mitsuba_taxel import Scene
    from mitsuba_taxel.surrogates import export_contact

    from ..tables import print_json, progress_bar, say

    output = output or Path("contact.npz")
    with progress_bar("patches, then bodies") as progress:
        model, notes = export_contact(
            Scene(scene, defines),
            output,
            depth,
            error=error,
            spacing=spacing,
            friction=friction,
            progress=progress,
        )
    rows, columns = model.covered.shape
    if as_json:
        errors = model.errors._asdict() if model.errors else None
        print_json({"rows": rows, "columns": columns, "errors": errors, "notes": notes, "file": str(output)})
    else:
        say(f"{rows} x {columns} patches of {model.size[0]:.3g} x {model.size[1]:.3g} mm, to {depth:g} mm.")
        for note in notes:
            say(note)
        say(f"Results: {output}")
    if model.errors and model.errors.reading_rms > error:
        ctx.exit(3)
