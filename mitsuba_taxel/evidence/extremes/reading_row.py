"""Result class of the extreme readings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

RIGHT = "right"
MOST_DEVIATIONS = 4.0
"""Allowed deviation between a reading and its reference, in combined errors."""


@dataclass(frozen=True)
class ReadingRow:
    """Result of one extreme case of a reading; missing values are NaN.

    Attributes
    ----------
    verdict : str
        ``right``, ``refused: ...`` with the message, or how the process ended; and a remark.
    wrong : str
        Description of a failure; empty if there is none.
    power : float
        Reading of the taxel that deviates most, in W.
    error : float
        Relative standard error of the reading due to light and mechanics.
    reference : float
        Reference value of the reading, in W.
    deviations : float
        Deviation of the reading from its reference value, divided by the combined error.
    by : str
        Source of the reference value.
    seconds : float
        CPU time, in s.
    megabytes : float
        Peak memory, in MB.
    """

    COLUMNS: ClassVar = {
        "case": ("case", ""),
        "verdict": ("verdict", ""),
        "power": ("power [W]", ".5e"),
        "error": ("error", ".1e"),
        "reference": ("reference [W]", ".5e"),
        "deviations": ("deviations", "+.1f"),
        "by": ("reference by", ""),
        "seconds": ("CPU s", ".1f"),
        "megabytes": ("MB", ".0f"),
    }
    case: str
    verdict: str
    wrong: str = ""
    power: float = math.nan
    error: float = math.nan
    reference: float = math.nan
    deviations: float = math.nan
    by: str = ""
    seconds: float = math.nan
    megabytes: float = math.nan
