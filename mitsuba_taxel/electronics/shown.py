"""Readings behind a circuit: volts, counts, noise, and their derivatives."""

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
    """Derivatives of the outputs of T taxels behind a circuit with respect to P parameters.

    Attributes
    ----------
    in_volts : Derivatives
        Derivatives of the readings in volts instead of watts.
    counts : (T, P) ndarray
        Derivatives in counts of the converter.
    noise_equivalent : (T, P) ndarray
        Change of the parameter that is equivalent to the noise; infinite where the derivative is 0.
    to_saturation : (T, P) ndarray
        Change of the parameter that brings the output to the circuit's limit, if the power is linear in it; 0 where the
        output is at the limit, infinite where the power does not change.
    """

    in_volts: Any
    counts: np.ndarray
    noise_equivalent: np.ndarray
    to_saturation: np.ndarray

    def rows(self) -> Iterator[dict[str, Any]]:
        """The derivatives as rows of a table, one for each taxel and parameter.

        Yields
        ------
        dict[str, Any]
            A row of ``Derivatives.rows`` in V, with the derivative in ``counts``, and the changes of the parameter
            ``noise_equivalent`` and ``to_saturation`` (see the attributes).
        """
        arrays = (self.counts, self.noise_equivalent, self.to_saturation)
        cells = zip(*(values.T.ravel().tolist() for values in arrays), strict=True)
        for row, (counts, noise, change) in zip(self.in_volts.rows(), cells, strict=True):
            yield {**row, "counts": counts, "noise_equivalent": noise, "to_saturation": change}


class Shown(NamedTuple):
    """Outputs of a circuit for the readings of T taxels: voltage, counts and noise.

    Attributes
    ----------
    voltage, error, noise : (T,) ndarray
        Voltage at the converter, its error due to the total error of the power, and 1 sigma of the noise of the
        electronics, all in V.
    counts : (T,) ndarray of int
        Counts of the converter.
    saturated : (T,) ndarray of bool
        Mask of the readings whose output is at the circuit's limit.
    step : float
        Voltage of one count, in V.
    derivatives : ShownDerivatives or None
        Derivatives of the readings, if these have derivatives.
    circuit : Circuit
        Phototransistor, load, buffer and converter.
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
        """The numbers by column name, which contains the unit."""
        return {
            "voltage_V": self.voltage,
            "voltage_error_V": self.error,
            "noise_V": self.noise,
            "counts": self.counts,
            "saturated": self.saturated,
        }

    @property
    def notes(self) -> list[str]:
        """Notes on what limits the numbers: saturation, an unused range, and noise below the converter's step."""
        notes = unused_range(self.circuit, int(self.counts.max(initial=0)))
        if self.saturated.any():
            notes.append(
                "saturated: the output is at the circuit's limit; at the converter's full scale readings do not depend "
                "on the force."
            )
        return [*notes, *resolution_notes(self.step, self.noise)]


def shown(circuit: Circuit, readings: Any) -> Shown:
    """Convert ``Readings`` to volts and counts behind a circuit.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    readings : Readings
        Readings of :func:`measure`; powers that are negative due to their error count as 0.

    Returns
    -------
    Shown
        Voltages, counts and their errors for each taxel, and derivatives if the readings have derivatives.
    """
    power = np.maximum(readings.power, 0.0)
    response, noise = respond(circuit, power), total_noise(circuit, power)
    error = response.rate * readings.total_error
    derivatives = None if readings.derivatives is None else _shown(circuit, readings.derivatives, noise)
    return Shown(
        response.voltage, error, noise, response.counts, response.saturated, circuit.step, derivatives, circuit
    )


def _shown(circuit: Circuit, derivatives: Any, noise: np.ndarray) -> ShownDerivatives:
    """Convert ``Derivatives`` in W to volts and counts behind a circuit, by the chain rule. ``noise`` (T,) is the noise
    of the readings in V."""
    response = respond(circuit, np.maximum(derivatives.power, 0.0))
    in_volts = replace(
        derivatives,
        units=tuple(unit.replace("W", "V", 1) for unit in derivatives.units),
        values=response.rate[:, None] * derivatives.values + 0.0,  # removes the minus sign of a zero
        standard_errors=response.rate[:, None] * derivatives.standard_errors,
        power=response.voltage,
        power_errors=response.rate * derivatives.power_errors,
    )
    with np.errstate(divide="ignore"):
        equivalent = np.divide(noise[:, None], np.abs(in_volts.values))
    margin = change_to_saturation(circuit, derivatives.power, derivatives.values)
    return ShownDerivatives(in_volts, in_volts.values / circuit.step, equivalent, margin)
