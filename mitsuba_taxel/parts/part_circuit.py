"""A circuit for a photo-reflector from its datasheet: current at a distance, dark current, drift."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.parts.card import distance_model
from mitsuba_taxel.parts.part import Part

SUPPLY = 3.3
"""Supply voltage, V."""
EFFICIENCY = 0.2
"""Assumed efficiency of the LED, W/A: datasheets of current by current give only its product with the transfer."""
NEEDED = ("collector_current_typical_A", "led_current_A", "collector_distance_mm")
OPTIONAL = {"dark_current_A": "dark_current", "dark_decade_K": "dark_decade", "transfer_drift_per_K": "transfer_drift"}
"""Parameters of a circuit, by the name of the figure in the file of a part."""
_E12 = (1.0, 1.2, 1.5, 1.8, 2.2, 2.7, 3.3, 3.9, 4.7, 5.6, 6.8, 8.2)
"""Standard resistances of a decade (E12 series, IEC 60063)."""


def circuit_of_part(part: Part) -> Circuit:
    """A circuit for a part, with a current per optical power that reproduces the currents of its datasheet.

    At the distance and LED current of the datasheet, the power that the detector receives under the datasheet's
    reflector (`distance_model`) gives the typical collector current. The load resistance is the largest of the E12
    series with which the largest collector current of the datasheet does not saturate the circuit, under the reflector
    at the distance of the largest current.

    Parameters
    ----------
    part : Part
        Part with electrical figures.

    Returns
    -------
    Circuit
        Circuit with a supply of `SUPPLY`.

    Raises
    ------
    InputError
        if the part does not have these figures.
    """
    figures = part.electrical
    missing = [name for name in NEEDED if not figures.get(name, 0) > 0]
    if missing:
        raise InputError(
            f"part {part.name} has no {', '.join(missing)}, which a circuit needs: add it to [electrical] of a file of "
            "the part."
        )

    # The transfer from the typical collector current at the distance of the datasheet.
    typical, led_current, distance = (figures[name] for name in NEEDED)
    power = float(distance_model(part, distance)[0])
    constants: dict[str, Any] = {parameter: figures[name] for name, parameter in OPTIONAL.items() if name in figures}
    transfer = float(f"{typical / (led_current * EFFICIENCY * power):.4g}")
    constants |= {"led_current": led_current, "led_efficiency": EFFICIENCY, "transfer": transfer}
    circuit = Circuit(supply=SUPPLY, load_resistance=1.0, **constants)

    # The load resistance from the largest current at the distance of the largest current.
    brightest = max([current for _, current in part.distance_curve], default=1.0)
    current_at_distance = brightest
    if part.distance_curve:
        heights, currents = zip(*sorted(part.distance_curve), strict=True)
        current_at_distance = float(np.interp(distance, heights, currents))
    largest = figures.get("collector_current_most_A", typical) * brightest / current_at_distance
    return replace(circuit, load_resistance=standard_resistance(circuit.limit / circuit.buffer_gain / largest))


def standard_resistance(resistance: float) -> float:
    """Round a resistance in Ohm down to a value of the E12 series."""
    decade = 10.0 ** math.floor(math.log10(resistance))
    return max(value * decade for value in _E12 if value * decade <= resistance * (1 + 1e-9))
