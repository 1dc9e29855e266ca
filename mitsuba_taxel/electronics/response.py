"""Response of a circuit to optical power: photocurrent, volts, counts, without linearisation.

A phototransistor with a floating base, after Ebers and Moll, passes

    I = I_L (1 - e^-u) / (1 - 2 e^-u + e^(a - u)),    u = V_CE / V_T,  a = V_half / V_T,  V_T = k T / q

of its photocurrent I_L at a voltage V_CE between collector and emitter: all of it far above V_half, half of it there
(the ratio of its gains forward and backward is e^a - 2). On a load R from emitter to ground, V_CE = V_supply - R I.
(J. J. Ebers, J. L. Moll, Proc. IRE 42, 1954, with the photocurrent in the base.)
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.electronics.circuit import Circuit

BISECTIONS = 80
"""Bisections of the range of voltages: enough for double precision."""
LARGEST_EXPONENT = 700.0
LEAST_CONDUCTANCE = 1e-200
"""Conductance in 1/Ohm below which the load counts as an open circuit."""


class Response(NamedTuple):
    """Response of a circuit to optical powers. Each array has the shape of the powers.

    Attributes
    ----------
    photocurrent : ndarray
        I_L in A, dark current included.
    voltage : ndarray
        Voltage that the converter reads, in V: at most its full scale.
    rate : ndarray
        Derivative of ``voltage`` with respect to the power, in V/W: 0 at and above the full scale.
    counts : ndarray of int
        Counts of the converter, from 0 to the largest.
    saturated : ndarray of bool
        Whether the output is at the circuit's limit (:attr:`Circuit.limit`).
    output : ndarray
        Voltage before the converter, in V: at most the supply. Noise is added to this voltage.
    output_rate : ndarray
        Derivative of ``output`` with respect to the power, in V/W.
    resistance : ndarray
        Small-signal resistance of the emitter's node in Ohm: the load in parallel with the phototransistor; 0 for an
        open emitter without any current, which stays at 0 V.
    passed : ndarray
        Fraction of the photocurrent that the phototransistor passes.
    """

    photocurrent: np.ndarray
    voltage: np.ndarray
    rate: np.ndarray
    counts: np.ndarray
    saturated: np.ndarray
    output: np.ndarray
    output_rate: np.ndarray
    resistance: np.ndarray
    passed: np.ndarray


def respond(circuit: Circuit, power: Any) -> Response:
    """Compute the response of a circuit to optical powers: photocurrent, voltage, counts and their slopes.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    power : array_like
        Optical powers in W, of any shape, at least 0.

    Returns
    -------
    Response
        Currents, voltages, counts and slopes, of the same shape.

    Raises
    ------
    InputError
        if a power is below 0.
    """
    power = np.asarray(power, dtype=float)
    if (power < 0).any():
        raise InputError(f"power = {power.min():g} is not allowed: at least 0 W is needed.")

    # Operating point: the collector-emitter voltage, the fraction of the photocurrent that passes, the emitter voltage.
    current = circuit.current_per_power * power + circuit.leakage
    with np.errstate(divide="ignore"):
        conductance = np.divide(1.0, circuit.load_resistance)
    u = _excess(circuit, current, conductance)
    passed, steepness = _passed(circuit, u)
    emitter = _emitter_voltage(circuit, current, conductance, u, passed)

    # Small-signal resistance of the emitter node, and the slope of the output where neither buffer nor supply limit it.
    node_conductance = conductance + current * steepness / circuit.thermal_voltage
    resistance = np.divide(
        1.0, node_conductance, out=np.zeros_like(node_conductance), where=node_conductance > LEAST_CONDUCTANCE
    )
    output = circuit.buffer_gain * emitter
    unlimited = (emitter < circuit.supply) & (output < circuit.supply)
    output_rate = np.where(unlimited, circuit.buffer_gain * passed * resistance * circuit.current_per_power, 0.0)
    output = np.minimum(output, circuit.supply)
    return Response(
        photocurrent=current,
        voltage=np.minimum(output, circuit.full_scale),
        rate=np.where(output < circuit.full_scale, output_rate, 0.0),
        counts=counts_of(circuit, output),
        saturated=output >= circuit.limit,
        output=output,
        output_rate=output_rate,
        resistance=resistance,
        passed=passed,
    )


def lit(power: Any) -> np.ndarray:
    """Replace powers that are missing (NaN), or negative due to noise, by 0, so that a circuit can process them.

    Parameters
    ----------
    power : array_like
        Powers in W, of any shape.

    Returns
    -------
    ndarray
        Powers in W, at least 0.
    """
    return np.maximum(np.nan_to_num(power), 0.0)


def counts_of(circuit: Circuit, voltage: Any) -> np.ndarray:
    """Convert voltages to counts of the converter.

    Parameters
    ----------
    circuit : Circuit
        Circuit with the converter.
    voltage : array_like
        Voltages in V, of any shape; NaN counts as 0.

    Returns
    -------
    ndarray of int
        Counts of the same shape, within the converter's range.
    """
    steps = np.floor(np.nan_to_num(np.asarray(voltage, dtype=float)) / circuit.step)
    return np.clip(steps, 0, 2**circuit.adc_bits - 1).astype(int)


def power_at(circuit: Circuit, voltage: Any) -> np.ndarray:
    """Optical power that gives a voltage at the converter: the inverse of :func:`respond`.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    voltage : array_like
        Voltages in V, of any shape, from 0 to below the supply.

    Returns
    -------
    ndarray
        Powers in W, of the same shape: negative where the dark current alone gives a higher voltage, NaN for a voltage
        that no power reaches.
    """
    voltage = np.asarray(voltage, dtype=float)
    emitter = voltage / circuit.buffer_gain
    possible = (voltage >= 0) & (voltage < circuit.supply) & (emitter < circuit.supply)
    u = np.where(possible, (circuit.supply - emitter) / circuit.thermal_voltage, np.nan)
    passed, _ = _passed(circuit, u)
    with np.errstate(divide="ignore", invalid="ignore"):
        return (np.divide(emitter, circuit.load_resistance) / passed - circuit.leakage) / circuit.current_per_power


def _excess(circuit: Circuit, current: np.ndarray, conductance: float) -> np.ndarray:
    """Voltage V_CE / V_T between collector and emitter, in thermal voltages, by bisection: the current of the
    phototransistor rises with it, and the current of the load falls."""
    low = np.zeros_like(current)
    high = np.full_like(current, circuit.supply / circuit.thermal_voltage)
    if np.isinf(conductance):
        return high
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        load = conductance * (circuit.supply - circuit.thermal_voltage * middle)
        too_high = current * _passed(circuit, middle)[0] > load
        low, high = np.where(too_high, low, middle), np.where(too_high, middle, high)
    return high


def _passed(circuit: Circuit, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fraction of the photocurrent that the phototransistor passes, and its derivative with respect to u."""
    exponent = circuit.saturation_voltage / circuit.thermal_voltage
    decay, forward = np.exp(-u), -np.expm1(-u)
    backward = np.exp(np.minimum(exponent - u, LARGEST_EXPONENT)) - decay
    total = forward + backward
    return forward / total, backward / total / total


def _emitter_voltage(
    circuit: Circuit, current: np.ndarray, conductance: float, u: np.ndarray, passed: np.ndarray
) -> np.ndarray:
    """Emitter voltage in V. It is computed from the current if it is small, and from supply minus V_CE if V_CE is
    small, so that no digits are lost."""
    if np.isinf(conductance):
        return np.zeros_like(current)
    collector_emitter = circuit.thermal_voltage * u
    with np.errstate(divide="ignore", invalid="ignore"):
        small = np.where(current > 0, current * passed / conductance, 0.0)
    return np.where((current > 0) & (collector_emitter < circuit.supply / 2), circuit.supply - collector_emitter, small)
