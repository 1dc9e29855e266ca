"""Samples of a circuit's output, noise included."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.electronics.noise import noise_parts
from mitsuba_taxel.electronics.response import counts_of, lit, respond


def sampled(circuit: Circuit, power: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw a noisy voltage, and its counts, for each optical power.

    The voltage has all noise except the quantisation of the converter; counts are the voltage rounded to the steps of
    the converter within its range. Missing and negative powers count as 0.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    power : ndarray
        Optical powers in W, of any shape.
    random : np.random.Generator
        Generator from which a normal number is drawn for each reading.

    Returns
    -------
    voltage : ndarray
        Voltage before the converter, V.
    counts : ndarray of int
        Counts of the converter.
    """
    power = lit(power)
    sources = noise_parts(circuit, power)
    deviation = np.sqrt(sum(source**2 for name, source in sources.items() if name != "quantisation"))
    output = respond(circuit, power).output + deviation * random.standard_normal(power.shape)
    return output, counts_of(circuit, output)
