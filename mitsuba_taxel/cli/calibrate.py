"""`taxel calibrate`: forces from readings, with intervals."""

from __future__ import annotations

from pathlib import Path

import click

from .options import Share, debug_option, json_option, output_option


@click.command(short_help="Forces from readings, with prediction intervals (ONNX).")
@click.argument("source", type=click.Path(path_type=Path), metavar="DIR|FILE.csv")
@output_option("calibration.onnx", "The calibration.")
@click.option(
    "--coverage", type=Share(), default="90%", show_default=True, help="Share of forces that intervals should contain."
)
@click.option(
    "--noise", type=Share(), show_default="0.5%, or that of the study's circuit alone",
    help="Relative noise added to the light of each reading of a study; a measurement has its own.",
)  # fmt: skip
@json_option
@debug_option
def command(source: Path, output: Path, coverage: float, noise: float | None, as_json: bool) -> None:
    """Fit forces to the readings of the study in DIR, or of a bench.

    The model is a polynomial of the readings, in volts if they are measured or the study has a circuit. It is
    cross-validated on whole paths: curves of a study, or runs of a measurement. Intervals are calibrated on paths that
    a fit has not seen.
    """
    from mitsuba_taxel import open_study
    from mitsuba_taxel.base.left_out import LEFT_OUT
    from mitsuba_taxel.characterise import read_measurement
    from mitsuba_taxel.surrogates import calibrate, write_calibration

    from .tables import print_json

    measured = source.suffix.lower() == ".csv"
    data = read_measurement(source) if measured else open_study(source)
    found = calibrate(data, coverage=coverage, noise=noise)
    write_calibration(found, output)
    widths = dict(zip(found.forces, found.half_width.tolist(), strict=True))
    if as_json:
        about = {"unit": found.unit, "half_width_N": widths, "coverage": found.coverage}
        about |= {"covered": found.covered, "tested": found.tested}
        print_json({**about, "rms_of_range": found.polynomial.rms, "file": str(output)})
        return
    for name, width in widths.items():
        print(f"{name}: +- {width:.3g} N holds {found.coverage:.0%}")
    print(f"Tested on {found.tested}: intervals by the others hold {found.covered:.1%}.")
    if not measured:
        both = " of the light and that of the circuit" if found.unit == "V" else ""
        noise_in_words = f"{found.noise:.2g} relative noise{both}"
        print(f"Readings in {found.unit} with {noise_in_words}; the study's own errors are not in it.")
    print(LEFT_OUT["calibration"])
    print(f"Results: {output}")
