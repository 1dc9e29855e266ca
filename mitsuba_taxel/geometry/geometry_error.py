"""What is wrong with a file of geometry, and where."""

from __future__ import annotations

import numpy as np


class GeometryError(Exception):
    """A reason why a pad's file cannot be used; whoever knows the file's name makes an `InputError` of it."""


def place(point: np.ndarray) -> str:
    """A point (3,) in mm as text."""
    x, y, z = (float(f"{coordinate:.3f}") + 0.0 for coordinate in point)
    return f"({x:g}, {y:g}, {z:g}) mm"
