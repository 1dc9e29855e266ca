"""Readings as a circuit shows them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.electronics.noise import total_noise
from mitsuba_taxel.electronics.response import respond


class Shown(NamedTuple):
    """Readings (T,) behind a circuit.

    Attributes
    ----------
    voltage, error, noise : (T,) ndarray
        In V: voltage at the converter, its error due to the power's total error, and 1 sigma of the electronics.
    counts : (T,) ndarray of int
    step : float
        Voltage of one count, in V.
    derivatives : Derivatives or None
        Those of the readings, in volts instead of watts.
    """

    voltage: np.ndarray
    error: np.ndarray
    noise: np.ndarray
    counts: np.ndarray
    step: float
    derivatives: Any

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The numbers by a name with its unit."""
        return {
            "voltage_V": self.voltage,
            "voltage_error_V": self.error,
            "noise_V": self.noise,
            "counts": self.counts,
        }

    def equivalent_noise(self) -> dict[str, np.ndarray]:
        """(T,) noise as an equivalent change of each parameter with a derivative, by its name and unit; infinite
        where the derivative is 0."""
        if self.derivatives is None:
            return {}
        found = {}
        for name, unit, slopes in zip(
            self.derivatives.parameters, self.derivatives.units, self.derivatives.values.T, strict=True
        ):
            with np.errstate(divide="ignore"):
                found[f"{name} [{unit.removeprefix('V/').replace('V', '1')}]"] = np.divide(self.noise, np.abs(slopes))
        return found


def shown(circuit: Circuit, readings: Any) -> Shown:
    """``Readings`` behind a circuit; derivatives follow by the chain rule, with the circuit's exact slope."""
    power = np.maximum(readings.power, 0.0)
    response, derivatives = respond(circuit, power), readings.derivatives
    if derivatives is not None:
        at = respond(circuit, np.maximum(derivatives.power, 0.0))
        derivatives = replace(
            derivatives,
            units=tuple(unit.replace("W", "V", 1) for unit in derivatives.units),
            values=at.rate[:, None] * derivatives.values,
            standard_errors=at.rate[:, None] * derivatives.standard_errors,
            power=at.voltage,
        )
    error = response.rate * readings.total_error
    noise = total_noise(circuit, power)
    return Shown(response.voltage, error, noise, response.counts, circuit.step, derivatives)
