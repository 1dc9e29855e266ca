"""Noise of a circuit, as standard deviations of the voltage at the converter."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mitsuba_taxel.electronics.circuit import BOLTZMANN, CHARGE, Circuit
from mitsuba_taxel.electronics.response import respond

FINE = math.sqrt(1 / 4 + 1 / 12)
"""Total noise, in steps of the converter, below which all noise before it is less than half a step: a steady signal
then stays within one step."""
RESOLUTION = (
    "Noise before the converter is less than half of its step of {step:.4g} V: noise as a force is a resolution (a "
    "step / sqrt(12)), which is the same in repeated samples and which no mean improves."
)

LEAST_USED, ENOUGH_COUNTS = 0.1, 1000
"""Share of the converter's range, and counts, below both of which a reading is remarked."""
FEW_COUNTS = 20
"""Signal in counts below which the steps of the converter are more than 5 % of it."""


def unused_range(circuit: Circuit, most: int) -> list[str]:
    """The remark that readings use little of the converter, and with which load they would use half of it.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    most : int
        Counts of the largest reading.

    Returns
    -------
    list[str]
        One remark or none.
    """
    counts = 2**circuit.adc_bits
    if most >= min(LEAST_USED * counts, ENOUGH_COUNTS):
        return []
    resistance = circuit.load_resistance * 0.5 * circuit.limit / ((most + 0.5) * circuit.step)
    remedy = (
        f"; load_resistance = {float(f'{resistance:.2g}'):g} would use half"
        if most > 0 and resistance < math.inf
        else ""
    )
    return [f"The largest reading is {most} of {counts} counts{remedy}."]


def resolution_notes(step: float, noise: np.ndarray) -> list[str]:
    """A note if the step of the converter hides the noise before it in any reading.

    Parameters
    ----------
    step : float
        Of the converter, V.
    noise : ndarray
        Total noise of each reading, V.

    Returns
    -------
    list[str]
        One note or none.
    """
    return [RESOLUTION.format(step=step)] if (noise < FINE * step).any() else []


def noise_parts(circuit: Circuit, power: Any) -> dict[str, np.ndarray]:
    """Noise of the output voltage by its source, as standard deviations.

    ``shot`` of the photocurrent, 2 q I (1 + 2 b): with a current gain b, the currents that feed its base and recombine
    there, each I / b, are amplified by b. ``thermal`` of the load, 4 k T R, in parallel with the resistance of the
    phototransistor. Both in the noise bandwidth of a first-order low pass, pi / 2 times its -3 dB bandwidth.
    ``flicker``, K^2 / f, from ``flicker_from`` on: K^2 / 2 ln(1 + (bandwidth / flicker_from)^2). ``other`` as given.
    ``quantisation`` of the converter, a step / sqrt(12), which assumes a signal uniformly distributed within a step: it
    does not hold for a signal that stays within one.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    power : array_like
        Optical powers in W, of any shape, at least 0.

    Returns
    -------
    dict[str, ndarray]
        By source, in V, of the shape of the powers; ``shot`` and ``thermal`` of a saturated output are 0.

    Raises
    ------
    InputError
        if a power is below 0.
    """
    shown = respond(circuit, power)
    width = math.pi / 2 * circuit.bandwidth
    per_current = circuit.buffer_gain * shown.resistance
    amplified = 1 + 2 * circuit.current_gain
    shot = 2 * CHARGE * shown.photocurrent * amplified * width
    with np.errstate(divide="ignore", invalid="ignore"):
        through_load = np.divide(shown.resistance, circuit.load_resistance)
        thermal = 4 * BOLTZMANN * circuit.kelvin * width * shown.resistance * through_load
    flicker = circuit.flicker_noise * math.sqrt(math.log1p((circuit.bandwidth / circuit.flicker_from) ** 2) / 2)
    alike = np.ones_like(shown.voltage)
    free = shown.output_rate > 0
    with np.errstate(invalid="ignore"):
        parts = {
            "shot": np.where(free, shown.passed * per_current * np.sqrt(shot), 0.0),
            "thermal": np.where(free, circuit.buffer_gain * np.sqrt(np.nan_to_num(thermal)), 0.0),
        }
    return parts | {
        "flicker": flicker * alike,
        "other": circuit.other_noise * alike,
        "quantisation": circuit.step / math.sqrt(12) * alike,
    }


def total_noise(circuit: Circuit, power: Any) -> np.ndarray:
    """All noise of the output voltage together; see :func:`noise_parts`.

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
