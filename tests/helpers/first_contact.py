"""Boxes of triangles, and the least displacement at which a pad touches something."""

from __future__ import annotations

import numpy as np

BOX = np.array(
    [[[0, 0, 0], [1, 1, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 0, 1], [1, 0, 1], [1, 1, 1]]]
    + [[[0, 0, 1], [1, 1, 1], [0, 1, 1]], [[0, 0, 0], [1, 0, 0], [1, 0, 1]], [[0, 0, 0], [1, 0, 1], [0, 0, 1]]]
    + [[[0, 1, 0], [1, 1, 1], [1, 1, 0]], [[0, 1, 0], [0, 1, 1], [1, 1, 1]], [[0, 0, 0], [0, 1, 1], [0, 1, 0]]]
    + [[[0, 0, 0], [0, 0, 1], [0, 1, 1]], [[1, 0, 0], [1, 1, 0], [1, 1, 1]], [[1, 0, 0], [1, 1, 1], [1, 0, 1]]],
    dtype=float,
)


def box(low, high):
    """Twelve triangles."""
    return np.array(low) + BOX * (np.array(high) - low)


def first_contact(test, displacement, low, high):
    """Least amplitude at which there is contact, and that contact; there is none at ``low``, and there is at ``high``.

    ``displacement`` is a function of the amplitude.
    """
    assert test.find(displacement(low)) is None
    contact = test.find(displacement(high))
    while high - low > 1e-8 * high:
        middle = (low + high) / 2
        at_middle = test.find(displacement(middle))
        low, high, contact = (low, middle, at_middle) if at_middle else (middle, high, contact)
    return high, contact
