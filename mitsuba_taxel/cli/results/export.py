"""`taxel export`: a study as a fast model."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import debug_option, json_option, output_option


@click.command(short_help="A study as a fast model for simulators (ONNX).")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@output_option("model.onnx", "The model.")
@json_option
@debug_option
def command(folder: Path, output: Path, as_json: bool) -> None:
    """Fit a model to the readings of the study in DIR, as a function of its varied parameters, and write it as ONNX.

    The model is a polynomial, cross-validated on whole paths; for a study with a circuit it also computes voltages and
    counts. Its output `inside` is false for inputs outside the ranges of the study. The file states units and errors.
    """
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
