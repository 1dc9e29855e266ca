"""Readings as a circuit shows them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.electronics.noise import resolution_notes, total_noise, unused_range
from mitsuba_taxel.electronics.response import respond
from mitsuba_taxel.electronics.saturation import change_to_saturation


class ShownDerivatives(NamedTuple):
    """Derivatives of T readings by P parameters behind a circuit.

    Attributes
    ----------
    in_volts : Derivatives
        Those of the readings, in volts instead of watts.
    counts : (T, P) ndarray
        The same in counts of the converter.
    noise_equivalent : (T, P) ndarray
        Noise as a change of the parameter; infinite where the derivative is 0.
    to_saturation : (T, P) ndarray
        Change of the parameter that brings the output to the circuit's limit, if the light follows its derivative; 0
        where it is there, infinite where the light does not change.
    """

    in_volts: Any
    counts: np.ndarray
    noise_equivalent: np.ndarray
    to_saturation: np.ndarray

    def rows(self) -> Iterator[dict[str, Any]]:
        """The derivatives one by one.

        Yields
        ------
        dict[str, Any]
            As of ``Derivatives.rows``, in V, with ``counts``, ``noise_equivalent`` and ``to_saturation`` beside.
        """
        others = (self.counts, self.noise_equivalent, self.to_saturation)
        cells = zip(*(values.T.ravel().tolist() for values in others), strict=True)
        for row, (counts, noise, change) in zip(self.in_volts.rows(), cells, strict=True):
            yield {**row, "counts": counts, "noise_equivalent": noise, "to_saturation": change}


class Shown(NamedTuple):
    """Readings (T,) behind a circuit.

    Attributes
    ----------
    voltage, error, noise : (T,) ndarray
        In V: voltage at the converter, its error due to the power's total error, and 1 sigma of the electronics.
    counts : (T,) ndarray of int
    saturated : (T,) ndarray of bool
        Where the output is at the circuit's limit.
    step : float
        Voltage of one count, in V.
    derivatives : ShownDerivatives or None
        Those of the readings.
    circuit : Circuit
    """

    voltage: np.ndarray
    error: np.ndarray
    noise: np.ndarray
    counts: np.ndarray
    saturated: np.ndarray
    step: float
    derivatives: ShownDerivatives | None
    circuit: Circuit

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The numbers by a name with its unit."""
        return {
            "voltage_V": self.voltage,
            "voltage_error_V": self.error,
            "noise_V": self.noise,
            "counts": self.counts,
            "saturated": self.saturated,
        }

    @property
    def notes(self) -> list[str]:
        """What limits the numbers: saturation, a range that is not used, and noise that the converter does not see."""
        notes = unused_range(self.circuit, int(self.counts.max(initial=0)))
        if self.saturated.any():
            notes.append(
                "saturated: the output is at the circuit's limit; from the converter's full scale on readings tell "
                "nothing."
            )
        return [*notes, *resolution_notes(self.step, self.noise)]


def shown(circuit: Circuit, readings: Any) -> Shown:
    """``Readings`` behind a circuit.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    readings : Readings
        Of :func:`measure`; powers that are negative by their error count as 0.

    Returns
    -------
    Shown
        Voltages, counts and their errors for each taxel; derivatives if the readings have them.
    """
    power = np.maximum(readings.power, 0.0)
    response, noise = respond(circuit, power), total_noise(circuit, power)
    error = response.rate * readings.total_error
    derivatives = None if readings.derivatives is None else _shown(circuit, readings.derivatives, noise)
    return Shown(
        response.voltage, error, noise, response.counts, response.saturated, circuit.step, derivatives, circuit
    )


def _shown(circuit: Circuit, derivatives: Any, noise: np.ndarray) -> ShownDerivatives:
    """``Derivatives`` behind a circuit, by the chain rule with its exact slope, with the noise (T,) of the readings."""
    at = respond(circuit, np.maximum(derivatives.power, 0.0))
    in_volts = replace(
        derivatives,
        units=tuple(unit.replace("W", "V", 1) for unit in derivatives.units),
        values=at.rate[:, None] * derivatives.values,
        standard_errors=at.rate[:, None] * derivatives.standard_errors,
        power=at.voltage,
        power_errors=at.rate * derivatives.power_errors,
    )
    with np.errstate(divide="ignore"):
        equivalent = np.divide(noise[:, None], np.abs(in_volts.values))
    margin = change_to_saturation(circuit, derivatives.power, derivatives.values)
    return ShownDerivatives(in_volts, in_volts.values / circuit.step, equivalent, margin)
