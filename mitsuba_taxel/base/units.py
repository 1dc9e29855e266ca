"""Names and units of the quantities in a study, and SI prefixes."""

from __future__ import annotations

import math

FORCES = ("fx", "fy", "fz")
"""Components of the force, in N."""
DISPLACEMENTS = ("ux", "uy", "uz")
"""Components of the displacement of a plate or an indenter, in mm."""
LOADS = (FORCES, DISPLACEMENTS, ("pressure",))
"""Names of the components of each kind of load."""
TIME = "time"
"""Time of the load, in s."""
HISTORY = "history"
"""Load history: rows of time and load."""
PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
"""SI prefixes by power of ten."""


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """Choose the SI prefix with which numbers up to ``largest`` are shown as at most 1000.

    Units of percent and dimensionless numbers have no prefix.

    Parameters
    ----------
    largest : float
        Largest magnitude of the numbers.
    unit : str
        Unit without prefix, such as W.

    Returns
    -------
    divisor : float
        Power of 1000 by which the numbers are divided.
    unit : str
        Unit with prefix, such as nW.
    """
    if not unit or unit.startswith("%") or not (math.isfinite(largest) and largest > 0):
        return 1.0, unit
    power = min(max(3 * math.floor(math.log10(largest * (1 + 1e-9)) / 3), min(PREFIXES)), max(PREFIXES))
    return 10.0**power, PREFIXES[power] + unit


def in_percent(fraction: float) -> str:
    """A fraction, such as a relative error, as text in percent.

    Parameters
    ----------
    fraction : float
        Number relative to 1.

    Returns
    -------
    str
        Text such as ``0.30%``; ``unknown`` if the number is not finite.
    """
    return f"{fraction:.2%}" if math.isfinite(fraction) else "unknown"
