"""Printed summaries of models and calibrations."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mitsuba_taxel.base.files.printed import Printed
from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.surrogates.calibration import Calibration
from mitsuba_taxel.surrogates.polynomial import Polynomial

LEAST_MISSED = 0.005
"""Shortfall of the tested coverage above which a remark is made, if it also exceeds its standard error."""


def printed_model(model: Polynomial, notes: Sequence[str]) -> Printed:
    """Summary of a model of readings: ranges of its inputs, its error, and notes.

    Parameters
    ----------
    model : Polynomial
        The model.
    notes : Sequence[str]
        Notes of `export`.

    Returns
    -------
    Printed
        Lines.
    """
    ranges = zip(model.names, model.low, model.high, model.units, strict=True)
    return [
        f"Error of the fit: {model.rms:.2%} of full scale (at worst {model.worst:.2%}), on {model.tested}.",
        *(f"{name}: {low:g} to {high:g} {unit}".removesuffix(" 1").rstrip() for name, low, high, unit in ranges),
        *notes,
    ]


def printed_calibration(calibration: Calibration) -> Printed:
    """Summary of a calibration: its intervals, their test, and what they do not include.

    Parameters
    ----------
    calibration : Calibration
        Result of :func:`calibrate`.

    Returns
    -------
    Printed
        Lines.
    """
    widths = zip(calibration.forces, calibration.half_width, calibration.units, strict=True)
    asked, paths, needed = f"{100 * calibration.coverage:.4g}%", calibration.paths, calibration.needed
    few, missed = paths < needed, calibration.coverage - calibration.covered
    missed_test = missed > max(calibration.covered_error, LEAST_MISSED)
    claim = "is meant to contain" if few or missed_test else "contains"
    printed: Printed = [
        f"{name}: +- {width:.3g} {unit} {claim} the {'force' if unit == 'N' else 'value'} with a probability of {asked}"
        for name, width, unit in widths
    ]
    if few:
        printed.append(
            f"{paths} paths are too few for {asked} by ranks of paths: at least {needed} are needed. Intervals are "
            "valid if errors of paths are normally distributed; for any distribution they contain "
            f"{paths / (paths + 1):.0%}."
        )
    test = (
        f"Tested on {calibration.tested}: intervals from the other paths contain {calibration.covered:.1%} +- "
        f"{calibration.covered_error:.1%} of the values"
    )
    printed.append(f"{test}, fewer than {asked}: more paths are needed." if missed_test else f"{test}.")
    if not math.isnan(calibration.noise):
        circuit_noise = " of the light and that of the circuit" if calibration.unit == "V" else ""
        noise = f"{calibration.noise:.2g} relative noise{circuit_noise}"
        printed.append(f"Readings in {calibration.unit} with {noise}; errors of the study's readings are not included.")
    if calibration.saturated:
        printed.append(calibration.saturated)
    return [*printed, LEFT_OUT["calibration"]]
