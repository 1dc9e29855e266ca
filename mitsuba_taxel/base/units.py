"""Units of the quantities in a study, and their SI prefixes."""

from __future__ import annotations

import math

FORCES = ("fx", "fy", "fz")
"""Parameters of a scene that are components of its force, in N."""
DISPLACEMENTS = ("ux", "uy", "uz")
"""Components of the displacement of a plate or an indenter, in mm."""
LOADS = (FORCES, DISPLACEMENTS, ("pressure",))
"""Components of each kind of load."""
TIME = "time"
"""Parameter of a scene that is the time of its load, in s."""
HISTORY = "history"
"""Parameter of a scene for the load history: rows of time and load."""
PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
"""Powers of ten and their names."""


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """Divisor that makes numbers up to ``largest`` at most 1000, and their unit with its prefix.

    Percent and dimensionless numbers get no prefix.

    Parameters
    ----------
    largest : float
        Largest magnitude of the numbers.
    unit : str
        Without prefix, such as W.

    Returns
    -------
    divisor : float
        A power of 1000.
    unit : str
        Such as nW.
    """
    if not unit or unit.startswith("%") or not (math.isfinite(largest) and largest > 0):
        return 1.0, unit
    power = min(max(3 * math.floor(math.log10(largest * (1 + 1e-9)) / 3), min(PREFIXES)), max(PREFIXES))
    return 10.0**power, PREFIXES[power] + unit


def in_percent(share: float) -> str:
    """A fraction, such as a relative error, in words.

    Parameters
    ----------
    share : float
        Relative to 1.

    Returns
    -------
    str
        Such as ``0.30%``, or ``unknown`` if it is not finite.
    """
    return f"{share:.2%}" if math.isfinite(share) else "unknown"
