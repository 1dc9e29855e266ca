"""`taxel calibrate`: forces, depth or place from readings, with intervals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..options import Fraction, debug_option, json_option, output_option


@click.command(short_help="Forces or places from readings, with prediction intervals (ONNX).")
@click.argument("source", type=click.Path(path_type=Path), metavar="DIR|FILE.csv")
@output_option("calibration.onnx", "File for the calibration.")
@click.option(
    "--coverage",
    type=Fraction(),
    default="90%",
    show_default=True,
    help="Fraction of the true values that the prediction intervals should contain.",
)
@click.option(
    "--noise", type=Fraction(), show_default="0.5%, or that of the study's circuit alone",
    help="Relative noise to add to the light of each reading of a study. A measurement has its own noise already.",
)  # fmt: skip
@click.option(
    "--over", multiple=True, type=click.Choice(["force", "depth", "place"]),
    show_default="the force if varied or measured, else the depth; and the place if varied",
    help="Quantity to estimate from readings; may be repeated.",
)  # fmt: skip
@json_option
@debug_option
def command(
    source: Path, output: Path, coverage: float, noise: float | None, over: tuple[str, ...], as_json: bool
) -> None:
    """Fit a model that estimates forces, depth or place from readings: of the study in DIR, or of a bench measurement.

    The model is a polynomial of the readings. They are in volts if they are measured or if the study has a circuit.

    Each estimate has a prediction interval. It follows from cross-validation: errors on whole paths (curves of a study,
    or runs of a measurement) that were left out of a fit are ranked.
    """
    from mitsuba_taxel import open_study
    from mitsuba_taxel.characterise import read_measurement
    from mitsuba_taxel.surrogates import calibrate, write_calibration
    from mitsuba_taxel.surrogates.wording import printed_calibration

    from ..tables import print_json, print_result, say

    data = read_measurement(source) if source.suffix.lower() == ".csv" else open_study(source)
    calibration = calibrate(data, coverage=coverage, noise=noise, over=over or None)
    write_calibration(calibration, output)
    widths = list(zip(calibration.forces, calibration.units, calibration.half_width.tolist(), strict=True))
    if as_json:
        about: dict[str, Any] = {
            f"half_width_{unit}": {name: width for name, own, width in widths if own == unit}
            for unit in dict.fromkeys(calibration.units)
        }
        about = {"unit": calibration.unit, **about, "coverage": calibration.coverage, "covered": calibration.covered}
        about |= {"covered_error": calibration.covered_error, "tested": calibration.tested}
        about |= {"paths": calibration.paths, "paths_needed": calibration.needed}
        print_json({**about, "rms_of_range": calibration.polynomial.rms, "file": str(output)})
        return
    print_result(printed_calibration(calibration))
    say(f"Results: {output}")
