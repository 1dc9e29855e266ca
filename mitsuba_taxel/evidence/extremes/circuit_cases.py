"""Extreme circuits: extreme load resistances and open emitters, no light and too much light, converters of 1 and of 24
bits.

Each voltage is compared with the solution of Kirchhoff's current law at the emitter, computed in decimal arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal, localcontext
from typing import Any

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.electronics import Circuit, respond, total_noise
from mitsuba_taxel.evidence.extremes.circuit_row import CircuitRow
from mitsuba_taxel.evidence.extremes.reading_row import RIGHT
from mitsuba_taxel.evidence.extremes.table_case import TimedCase

DIGITS, BISECTIONS = 60, 150
"""Decimal digits of the reference, and number of bisections."""
MOST_DIFFERENCE = 1e-9
"""Allowed relative difference from the reference."""
LEAST = 1e-200
"""Allowed absolute difference from the reference, in V."""


@dataclass(frozen=True)
class CircuitCase(TimedCase):
    """An extreme case of a circuit.

    Attributes
    ----------
    power : float
        Optical power on the phototransistor, in W.
    settings : dict[str, Any]
        Parameters of the circuit that differ from a supply of 3.3 V, a load resistance of 10 kOhm and a transfer of 8
        mA/W.
    """

    ROW = CircuitRow
    name: str
    power: float
    settings: dict[str, Any] = field(default_factory=dict)

    def _row(self) -> CircuitRow:
        try:
            circuit = Circuit(**{"supply": 3.3, "load_resistance": 1e4, "transfer": 8e-3, **self.settings})
            response, noise = respond(circuit, self.power), float(total_noise(circuit, self.power))
        except InputError as error:
            return CircuitRow(self.name, f"refused: {error}", wrong="it should not be refused")
        exact = emitter_voltage(circuit, self.power)
        reference = min(circuit.buffer_gain * float(exact), circuit.supply, circuit.full_scale)
        voltage, counts = float(response.voltage), int(response.counts)
        return CircuitRow(
            case=self.name,
            verdict=RIGHT,
            wrong=_flaw(circuit, voltage, reference, counts, noise),
            voltage=voltage,
            reference=reference,
            counts=counts,
            noise=noise,
        )


def circuit_cases() -> list[CircuitCase]:
    """All extreme cases of circuits, in the order of the table."""
    return [case for kind in (_loads, _lights, _converters) for case in kind()]


def emitter_voltage(circuit: Circuit, power: float) -> Decimal:
    """Reference value of a voltage: the voltage at which the current of the phototransistor equals that of the load
    resistance, by bisection in decimal arithmetic.

    Parameters
    ----------
    circuit : Circuit
        The circuit.
    power : float
        Optical power in W.

    Returns
    -------
    Decimal
        Voltage of the emitter in V.
    """
    with localcontext() as context:
        context.prec = DIGITS
        if circuit.load_resistance == 0:
            return Decimal(0)
        supply, saturation, thermal = (
            Decimal(number) for number in (circuit.supply, circuit.saturation_voltage, circuit.thermal_voltage)
        )
        light = Decimal(circuit.current_per_power) * Decimal(power) + Decimal(circuit.leakage)
        if not light:
            return Decimal(0)
        conductance = 0 if math.isinf(circuit.load_resistance) else 1 / Decimal(circuit.load_resistance)

        def surplus(voltage: Decimal) -> Decimal:
            """Current into the emitter node: that of the phototransistor (Ebers and Moll) minus that of the load."""
            reverse = (-(supply - voltage) / thermal).exp()
            return (
                light * (1 - reverse) / (1 - 2 * reverse + (saturation / thermal).exp() * reverse)
                - conductance * voltage
            )

        low, high = Decimal(0), supply
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            low, high = (middle, high) if surplus(middle) > 0 else (low, middle)
        return (low + high) / 2


def _flaw(circuit: Circuit, voltage: float, reference: float, counts: int, noise: float) -> str:
    """Reason why the response of a circuit counts as a failure; empty if it does not."""
    allowed = MOST_DIFFERENCE * reference + LEAST
    if not abs(voltage - reference) <= allowed:
        return "another voltage"
    lowest, highest = ((reference + offset) / circuit.step for offset in (-allowed, allowed))
    largest = 2**circuit.adc_bits - 1
    if not min(max(math.floor(lowest), 0), largest) <= counts <= min(math.floor(highest), largest):
        return "other counts"
    return "" if math.isfinite(noise) and noise >= circuit.step / math.sqrt(12) else "the noise is not a number"


def _loads() -> Iterator[CircuitCase]:
    for resistance in (0.0, 1e-12, 1e12, math.inf):
        yield CircuitCase(f"load of {resistance:g} Ohm, 1 mW", 1e-3, {"load_resistance": resistance})
    yield CircuitCase("open emitter, no current", 0.0, {"load_resistance": math.inf})
    yield CircuitCase("open emitter, 1e-30 W", 1e-30, {"load_resistance": math.inf})


def _lights() -> Iterator[CircuitCase]:
    yield CircuitCase("no light, no dark current", 0.0)
    yield CircuitCase("no light, dark current of 1e-9 A", 0.0, {"dark_current": 1e-9})
    yield CircuitCase("no light, 500 degrees C", 0.0, {"dark_current": 1e-9, "temperature": 500.0})
    yield CircuitCase("1 mW at -200 degrees C", 1e-3, {"temperature": -200.0})
    for power in (1e-30, 0.05, 1e6):
        yield CircuitCase(f"{power:g} W", power)
    yield CircuitCase("1e+06 W, saturation voltage of 0", 1e6, {"saturation_voltage": 0.0})
    yield CircuitCase("1e+06 W, buffer gain of 1e6", 1e6, {"buffer_gain": 1e6})


def _converters() -> Iterator[CircuitCase]:
    for bits in (1, 24):
        for power, words in ((0.0, "no light"), (0.02, "20 mW"), (0.021, "21 mW"), (1e6, "1e+06 W")):
            yield CircuitCase(f"converter of {bits} bit, {words}", power, {"adc_bits": bits})
