"""One row of the table of extreme readings, and its cells as text."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mitsuba_taxel.bench.row import cell

RIGHT = "right"
MOST_DEVIATIONS = 4.0
"""Allowed deviation between a reading and its reference, in combined errors."""


@dataclass(frozen=True)
class ReadingRow:
    """Result of a case; missing values are NaN.

    Attributes
    ----------
    verdict : str
        ``right``, ``refused: ...`` with the message, or how the process ended; and a remark.
    wrong : str
        Failure, empty if there is none.
    power : float
        In W, of the worst taxel.
    error : float
        Relative, of light and mechanics.
    reference : float
        In W, expected reading.
    deviations : float
        Deviation of the reading from it, in combined errors.
    by : str
        Source of the reference.
    seconds : float
        CPU time.
    megabytes : float
        Peak memory.
    """

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


READING_HEADINGS = {
    "case": "case",
    "verdict": "verdict",
    "power": "power [W]",
    "error": "error",
    "reference": "reference [W]",
    "deviations": "deviations",
    "by": "reference by",
    "seconds": "CPU s",
    "megabytes": "MB",
}
_FORMS = {
    "power": ".5e",
    "error": ".1e",
    "reference": ".5e",
    "deviations": "+.1f",
    "seconds": ".1f",
    "megabytes": ".0f",
}


def reading_cells(row: ReadingRow) -> list[str]:
    """The row's cells as text, in the order of :data:`READING_HEADINGS`; "-" where there is no number."""
    return [cell(row, name, _FORMS) for name in READING_HEADINGS]
