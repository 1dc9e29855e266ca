"""Piecewise linear approximation of a circuit's response, for runtimes that can only add and multiply."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.electronics.response import respond

SHARE_OF_COUNT, SHARE_OF_SUPPLY = 0.02, 1e-5
"""Largest error of a piece, as a fraction of a count or as a fraction of the supply voltage: the larger applies."""
MOST_HALVINGS = 30
"""Largest number of halvings of the range of powers, near a corner of the response."""


def straight_pieces(circuit: Circuit, most: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a piecewise linear function that approximates the response of a circuit to powers up to ``most``.

    Pieces are halved until the response at a quarter, the middle and three quarters of each is within
    :data:`SHARE_OF_COUNT` of a count or :data:`SHARE_OF_SUPPLY` of the supply.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    most : float
        Largest power, W.

    Returns
    -------
    power, voltage : (K,) ndarray
        Powers in W and voltages in V at the K corners; the first power is 0, the last is ``most``.
    """
    allowed = max(SHARE_OF_COUNT * circuit.step, SHARE_OF_SUPPLY * circuit.supply)
    power = np.array([0.0, most])
    for _ in range(MOST_HALVINGS):
        inside = power[:-1, None] + np.diff(power)[:, None] * [0.25, 0.5, 0.75]
        voltage = respond(circuit, power).voltage
        error = np.abs(respond(circuit, inside).voltage - np.interp(inside, power, voltage)).max(axis=1)
        if (error <= allowed).all():
            break
        power = np.sort(np.concatenate([power, inside[error > allowed, 1]]))
    return power, respond(circuit, power).voltage
