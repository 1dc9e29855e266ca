"""Noise of a circuit, as standard deviations of the voltage at the converter."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mitsuba_taxel.electronics.circuit import BOLTZMANN, CHARGE, Circuit
from mitsuba_taxel.electronics.response import respond

FINE = math.sqrt(1 / 4 + 1 / 12)
"""Total noise, in steps of the converter, below which the noise before the converter is less than half a step: a
constant signal then stays within one step."""
RESOLUTION = (
    "The noise before the converter is less than half of its step of {step:.4g} V: the noise-equivalent force is then "
    "a resolution (step / sqrt(12)), which is the same in repeated samples and is not reduced by averaging."
)

LEAST_USED, ENOUGH_COUNTS = 0.1, 1000
"""Fraction of the converter's range, and counts: a largest reading below both gets a note."""
FEW_COUNTS = 20
"""Signal in counts below which a step of the converter is more than 5 % of the signal."""


def unused_range(circuit: Circuit, largest: int) -> list[str]:
    """A note if the largest reading uses a small part of the converter's range; it names a better load resistance.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    largest : int
        Counts of the largest reading.

    Returns
    -------
    list[str]
        The note, or empty.
    """
    counts = 2**circuit.adc_bits
    if largest >= min(LEAST_USED * counts, ENOUGH_COUNTS):
        return []
    resistance = circuit.load_resistance * 0.5 * circuit.limit / ((largest + 0.5) * circuit.step)
    remedy = (
        f"; load_resistance = {float(f'{resistance:.2g}'):g} would use half of the range"
        if largest > 0 and resistance < math.inf
        else ""
    )
    return [f"The largest reading is {largest} of {counts} counts{remedy}."]


def resolution_notes(step: float, noise: np.ndarray) -> list[str]:
    """A note if, in any reading, the noise at the converter's input is smaller than its steps can resolve.

    Parameters
    ----------
    step : float
        Step of the converter, V.
    noise : ndarray
        Total noise of each reading, V.

    Returns
    -------
    list[str]
        The note, or empty.
    """
    return [RESOLUTION.format(step=step)] if (noise < FINE * step).any() else []


def noise_parts(circuit: Circuit, power: Any) -> dict[str, np.ndarray]:
    """Noise of the output voltage by its source, as standard deviations.

    - ``shot``: noise of the photocurrent, of density 2 q I (1 + 2 b). With a current gain b, the currents that feed the
      base and recombine there, each I / b, are amplified by b.
    - ``thermal``: noise of the load, of density 4 k T R, with the resistance of the phototransistor in parallel. Shot
      and thermal noise are taken in the noise bandwidth of a first-order low pass, pi / 2 times its -3 dB bandwidth.
    - ``flicker``: noise of density K^2 / f above ``flicker_from``, K^2 / 2 ln(1 + (bandwidth / flicker_from)^2).
    - ``other``: ``other_noise`` of the circuit.
    - ``quantisation``: step / sqrt(12) of the converter. This assumes a signal that is uniformly distributed within a
      step; it is not valid for a signal that stays within one step.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    power : array_like
        Optical powers in W, of any shape, at least 0.

    Returns
    -------
    dict[str, ndarray]
        Standard deviations in V by source, of the shape of the powers; ``shot`` and ``thermal`` of a saturated output
        are 0.

    Raises
    ------
    InputError
        if a power is below 0.
    """
    response = respond(circuit, power)
    noise_bandwidth = math.pi / 2 * circuit.bandwidth
    per_current = circuit.buffer_gain * response.resistance
    amplified = 1 + 2 * circuit.current_gain
    shot = 2 * CHARGE * response.photocurrent * amplified * noise_bandwidth
    with np.errstate(divide="ignore", invalid="ignore"):
        through_load = np.divide(response.resistance, circuit.load_resistance)
        thermal = 4 * BOLTZMANN * circuit.kelvin * noise_bandwidth * response.resistance * through_load

    # Shot and thermal noise vanish where the output is limited.
    flicker = circuit.flicker_noise * math.sqrt(math.log1p((circuit.bandwidth / circuit.flicker_from) ** 2) / 2)
    unity = np.ones_like(response.voltage)
    unlimited = response.output_rate > 0
    with np.errstate(invalid="ignore"):
        limited = {
            "shot": np.where(unlimited, response.passed * per_current * np.sqrt(shot), 0.0),
            "thermal": np.where(unlimited, circuit.buffer_gain * np.sqrt(np.nan_to_num(thermal)), 0.0),
        }
    return limited | {
        "flicker": flicker * unity,
        "other": circuit.other_noise * unity,
        "quantisation": circuit.step / math.sqrt(12) * unity,
    }


def total_noise(circuit: Circuit, power: Any) -> np.ndarray:
    """Total noise of the output voltage; see :func:`noise_parts` for its sources.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    power : array_like
        Optical powers in W, of any shape, at least 0.

    Returns
    -------
    ndarray
        One standard deviation in V, of the shape of the powers.

    Raises
    ------
    InputError
        if a power is below 0.
    """
    return np.sqrt(sum(noise_part**2 for noise_part in noise_parts(circuit, power).values()))
