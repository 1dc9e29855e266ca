"""Samples of a circuit's output, noise included."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.electronics.noise import noise_parts
from mitsuba_taxel.electronics.response import counts_of, lit, respond


def sampled(circuit: Circuit, power: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """One sample of each reading, with its noise.

    The voltage has all noise but that of the converter, whose steps and range the counts contain. Missing and negative
    powers are read as 0.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    power : ndarray
        Optical powers in W, of any shape.
    random : np.random.Generator
        Of which one normal number is drawn for each reading.

    Returns
    -------
    voltage : ndarray
        Before the converter, V.
    counts : ndarray of int
        Of the converter.
    """
    power = lit(power)
    parts = noise_parts(circuit, power)
    deviation = np.sqrt(sum(part**2 for name, part in parts.items() if name != "quantisation"))
    output = respond(circuit, power).output + deviation * random.standard_normal(power.shape)
    return output, counts_of(circuit, output)
