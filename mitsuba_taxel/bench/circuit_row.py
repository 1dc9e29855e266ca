"""One row of the table of extreme circuits, and its cells as text."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mitsuba_taxel.bench.row import cell


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
        At the converter, in V, and expected.
    counts : float
        Of the converter.
    noise : float
        One standard deviation, in V.
    seconds : float
        CPU time.
    megabytes : float
        Peak memory.
    """

    case: str
    verdict: str
    wrong: str = ""
    voltage: float = math.nan
    reference: float = math.nan
    counts: float = math.nan
    noise: float = math.nan
    seconds: float = math.nan
    megabytes: float = math.nan


CIRCUIT_HEADINGS = {
    "case": "case",
    "verdict": "verdict",
    "voltage": "voltage [V]",
    "reference": "reference [V]",
    "counts": "counts",
    "noise": "noise [V]",
    "seconds": "CPU s",
    "megabytes": "MB",
}
_FORMS = {
    "voltage": ".9g",
    "reference": ".9g",
    "counts": ".0f",
    "noise": ".2e",
    "seconds": ".1f",
    "megabytes": ".0f",
}


def circuit_cells(row: CircuitRow) -> list[str]:
    """The row's cells as text, in the order of :data:`CIRCUIT_HEADINGS`; "-" where there is no number."""
    return [cell(row, name, _FORMS) for name in CIRCUIT_HEADINGS]
