"""A circuit for a photo-reflector by what its datasheet states: current at a distance, dark current, drift."""

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
"""V"""
EFFICIENCY = 0.2
"""W/A, assumed of the LED; a datasheet of current by current states only its product with the transfer."""
NEEDED = ("collector_current_typical_A", "led_current_A", "collector_distance_mm")
OPTIONAL = {"dark_current_A": "dark_current", "dark_decade_K": "dark_decade", "transfer_drift_per_K": "transfer_drift"}
"""By the name of a figure in a file of a part, the value of a circuit."""
_E12 = (1.0, 1.2, 1.5, 1.8, 2.2, 2.7, 3.3, 3.9, 4.7, 5.6, 6.8, 8.2)
"""Resistances of a decade that are sold (IEC 60063)."""


def circuit_of_part(part: Part) -> Circuit:
    """A circuit behind which a scene with this part has the current of its datasheet.

    The power that the detector gets of 1 W of the LED under the reflector of the datasheet (`distance_model`), at its
    distance and LED current, is the typical collector current. The load is the largest of the E12 series with which
    the largest current that the datasheet allows, under its reflector at the brightest distance, does not saturate.

    Parameters
    ----------
    part : Part
        With its electrical figures.

    Returns
    -------
    Circuit
        With a supply of `SUPPLY`.

    Raises
    ------
    InputError
        if the part does not state these figures.
    """
    figures = part.electrical
    missing = [name for name in NEEDED if not figures.get(name, 0) > 0]
    if missing:
        raise InputError(
            f"part {part.name} states no {', '.join(missing)}, which a circuit needs: add it to [electrical] of a file "
            "of the part."
        )
    typical, led_current, distance = (figures[name] for name in NEEDED)
    power = float(distance_model(part, distance)[0])
    stated: dict[str, Any] = {ours: figures[name] for name, ours in OPTIONAL.items() if name in figures}
    transfer = float(f"{typical / (led_current * EFFICIENCY * power):.4g}")
    stated |= {"led_current": led_current, "led_efficiency": EFFICIENCY, "transfer": transfer}
    circuit = Circuit(supply=SUPPLY, load_resistance=1.0, **stated)
    brightest = max([share for _, share in part.distance_curve], default=1.0)
    at_distance = _share_at(part, distance) if part.distance_curve else brightest
    most = figures.get("collector_current_most_A", typical) * brightest / at_distance
    return replace(circuit, load_resistance=sold_below(circuit.limit / circuit.buffer_gain / most))


def _share_at(part: Part, distance: float) -> float:
    """Of the largest current, at a distance in mm, linear between the points of the curve."""
    heights, shares = zip(*sorted(part.distance_curve), strict=True)
    return float(np.interp(distance, heights, shares))


def sold_below(resistance: float) -> float:
    """The largest resistance of the E12 series that is not above one in Ohm."""
    decade = 10.0 ** math.floor(math.log10(resistance))
    return max(each * decade for each in _E12 if each * decade <= resistance * (1 + 1e-9))
