"""One row of the table of stated and true errors of readings, and its cells as text."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mitsuba_taxel.bench.row import cell


@dataclass(frozen=True)
class CoverageRow:
    """What became of a setting; missing values are NaN.

    Attributes
    ----------
    remark : str
        Why there is no true or no stated error, empty where there are both.
    elements : float
        Of the pad.
    true : float
        Relative error of the reading of the taxel that is worst, by the finite elements.
    stated : float
        The relative error that it states for them.
    noise : float
        Relative standard error of `true` by the light.
    extrapolated : float
        Of the truth, by how much the finest elements are extrapolated, relative.
    readings : float
        Number of taxels.
    within : float
        Of these, how many are true within twice the stated error (and twice the noise).
    seconds : float
        Of processors' time.
    """

    case: str
    remark: str = ""
    elements: float = math.nan
    true: float = math.nan
    stated: float = math.nan
    noise: float = math.nan
    extrapolated: float = math.nan
    readings: float = math.nan
    within: float = math.nan
    seconds: float = math.nan

    @property
    def ratio(self) -> float:
        """True error, relative to the stated one."""
        return self.true / self.stated if self.stated else math.inf


HEADINGS = {
    "case": "setting",
    "elements": "elements",
    "true": "true",
    "stated": "stated",
    "ratio": "true / stated",
    "noise": "noise",
    "extrapolated": "truth extrapolated by",
    "readings": "readings",
    "within": "within twice",
    "seconds": "CPU s",
    "remark": "remark",
}
_FORMS = {
    "elements": ".0f",
    "true": ".3%",
    "stated": ".3%",
    "ratio": ".2f",
    "noise": ".3%",
    "extrapolated": ".3%",
    "readings": ".0f",
    "within": ".0f",
    "seconds": ".0f",
}


def coverage_cells(row: CoverageRow) -> list[str]:
    """The row's cells as text, in the order of :data:`HEADINGS`; "-" where there is no number."""
    return [cell(row, name, _FORMS) for name in HEADINGS]
