"""Models and calibrations as they are printed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.base.printed import Printed
from mitsuba_taxel.surrogates.calibration import Calibration
from mitsuba_taxel.surrogates.polynomial import Polynomial


def printed_model(found: Polynomial, notes: Sequence[str]) -> Printed:
    """A model of readings: ranges of its inputs, its error, and notes.

    Parameters
    ----------
    found : Polynomial
        As :func:`export` returns it.
    notes : sequence of str
        As :func:`export` returns them.

    Returns
    -------
    Printed
        Lines.
    """
    ranges = zip(found.names, found.low, found.high, found.units, strict=True)
    return [
        *(f"{name}: {low:g} to {high:g} {unit}".removesuffix(" 1").rstrip() for name, low, high, unit in ranges),
        f"Error of the fit: {found.rms:.2%} of full scale (at worst {found.worst:.2%}), on {found.tested}.",
        *notes,
    ]


def printed_calibration(found: Calibration) -> Printed:
    """A calibration: its intervals, how they were tested, and what they leave out.

    Parameters
    ----------
    found : Calibration
        As :func:`calibrate` returns it.

    Returns
    -------
    Printed
        Lines.
    """
    widths = zip(found.forces, found.half_width, strict=True)
    printed: Printed = [f"{name}: +- {width:.3g} N holds {found.coverage:.0%}" for name, width in widths]
    printed.append(f"Tested on {found.tested}: intervals by the others hold {found.covered:.1%}.")
    if not math.isnan(found.noise):
        both = " of the light and that of the circuit" if found.unit == "V" else ""
        noise = f"{found.noise:.2g} relative noise{both}"
        printed.append(f"Readings in {found.unit} with {noise}; the study's own errors are not in it.")
    return [*printed, LEFT_OUT["calibration"]]
