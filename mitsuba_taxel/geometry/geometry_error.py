"""Errors in a file of geometry, with their coordinates."""

from __future__ import annotations

import numpy as np


class GeometryError(Exception):
    """A file of geometry cannot be used, for the reason in the message. Callers that know the name of the file turn
    this error into an `InputError`.
    """


def place(point: np.ndarray) -> str:
    """Format the coordinates of a point as text for messages.

    Parameters
    ----------
    point : (3,) ndarray
        Position in mm.

    Returns
    -------
    str
        Coordinates to a micrometre.
    """
    x, y, z = (float(f"{coordinate:.3f}") + 0.0 for coordinate in point)
    return f"({x:g}, {y:g}, {z:g}) mm"
