"""One row of the table of extreme circuits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class CircuitRow:
    """Result of a case; missing values are NaN.

    Attributes
    ----------
    verdict : str
        ``right``, ``refused: ...`` with the message, or how the process ended.
    wrong : str
        Failure, empty if there is none.
    voltage, reference : float
        Voltage at the converter and its expected value, in V.
    counts : float
        Output of the converter.
    noise : float
        One standard deviation, in V.
    seconds : float
        CPU time.
    megabytes : float
        Peak memory.
    """

    COLUMNS: ClassVar = {
        "case": ("case", ""),
        "verdict": ("verdict", ""),
        "voltage": ("voltage [V]", ".9g"),
        "reference": ("reference [V]", ".9g"),
        "counts": ("counts", ".0f"),
        "noise": ("noise [V]", ".2e"),
        "seconds": ("CPU s", ".1f"),
        "megabytes": ("MB", ".0f"),
    }
    case: str
    verdict: str
    wrong: str = ""
    voltage: float = math.nan
    reference: float = math.nan
    counts: float = math.nan
    noise: float = math.nan
    seconds: float = math.nan
    megabytes: float = math.nan
