"""`taxel calibrate`: forces from readings, with intervals."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import Fraction, debug_option, json_option, output_option


@click.command(short_help="Forces from readings, with prediction intervals (ONNX).")
@click.argument("source", type=click.Path(path_type=Path), metavar="DIR|FILE.csv")
@output_option("calibration.onnx", "The calibration.")
@click.option(
    "--coverage",
    type=Fraction(),
    default="90%",
    show_default=True,
    help="Share of forces that intervals should contain.",
)
@click.option(
    "--noise", type=Fraction(), show_default="0.5%, or that of the study's circuit alone",
    help="Relative noise added to the light of each reading of a study; a measurement has its own.",
)  # fmt: skip
@json_option
@debug_option
def command(source: Path, output: Path, coverage: float, noise: float | None, as_json: bool) -> None:
    """Fit a model of the forces to the readings of the study in DIR, or of a bench measurement.

    The model is a polynomial of the readings, in volts if they are measured or the study has a circuit. It is
    cross-validated on whole paths: curves of a study, or runs of a measurement. Intervals are calibrated on paths that
    a fit has not seen.
    """
    from mitsuba_taxel import open_study
    from mitsuba_taxel.characterise import read_measurement
    from mitsuba_taxel.surrogates import calibrate, write_calibration
    from mitsuba_taxel.surrogates.wording import printed_calibration

    from ..tables import print_json, print_result, say

    data = read_measurement(source) if source.suffix.lower() == ".csv" else open_study(source)
    calibration = calibrate(data, coverage=coverage, noise=noise)
    write_calibration(calibration, output)
    widths = dict(zip(calibration.forces, calibration.half_width.tolist(), strict=True))
    if as_json:
        about = {"unit": calibration.unit, "half_width_N": widths, "coverage": calibration.coverage}
        about |= {"covered": calibration.covered, "tested": calibration.tested}
        print_json({**about, "rms_of_range": calibration.polynomial.rms, "file": str(output)})
        return
    print_result(printed_calibration(calibration))
    say(f"Results: {output}")
