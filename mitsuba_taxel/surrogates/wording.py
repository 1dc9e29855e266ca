"""Printed summaries of models and calibrations."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mitsuba_taxel.base.files.printed import Printed
from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.surrogates.calibration import Calibration
from mitsuba_taxel.surrogates.polynomial import Polynomial


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
    widths = zip(calibration.forces, calibration.half_width, strict=True)
    printed: Printed = [
        f"{name}: +- {width:.3g} N contains the force with a probability of {calibration.coverage:.0%}"
        for name, width in widths
    ]
    printed.append(
        f"Tested on {calibration.tested}: intervals from the other paths contain "
        f"{calibration.covered:.1%} of the forces."
    )
    if not math.isnan(calibration.noise):
        circuit_noise = " of the light and that of the circuit" if calibration.unit == "V" else ""
        noise = f"{calibration.noise:.2g} relative noise{circuit_noise}"
        printed.append(f"Readings in {calibration.unit} with {noise}; the study's own errors are not in it.")
    if calibration.saturated:
        printed.append(calibration.saturated)
    return [*printed, LEFT_OUT["calibration"]]
