"""The response of a circuit as straight pieces, for programs that only add and multiply."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.electronics.response import respond

SHARE_OF_COUNT, SHARE_OF_SUPPLY = 0.02, 1e-5
"""Largest error of a piece: the first of a count, or the second of the supply where that is more."""
MOST_HALVINGS = 30
"""Of the range of powers, towards a corner of the response."""


def straight_pieces(circuit: Circuit, most: float) -> tuple[np.ndarray, np.ndarray]:
    """Powers in W from 0 to ``most``, and voltages there in V, between which the response is straight.

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
        Ends of the pieces in W and V.
    """
    allowed = max(SHARE_OF_COUNT * circuit.step, SHARE_OF_SUPPLY * circuit.supply)
    power = np.array([0.0, most])
    for _ in range(MOST_HALVINGS):
        inside = power[:-1, None] + np.diff(power)[:, None] * [0.25, 0.5, 0.75]
        voltage = respond(circuit, power).voltage
        off = np.abs(respond(circuit, inside).voltage - np.interp(inside, power, voltage)).max(axis=1)
        if (off <= allowed).all():
            break
        power = np.sort(np.concatenate([power, inside[off > allowed, 1]]))
    return power, respond(circuit, power).voltage
