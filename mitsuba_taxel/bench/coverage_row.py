"""One row of the table of stated and true errors of readings, and its cells as text."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mitsuba_taxel.bench.row import cell


@dataclass(frozen=True)
class CoverageRow:
    """Result of a setting; missing values are NaN.

    Attributes
    ----------
    remark : str
        Reason why there is no true or no stated error, empty if there are both.
    elements : float
        Of the pad.
    true : float
        Relative error of the reading of the worst taxel due to the finite elements.
    corrected : float
        True error after the estimated error, with its sign, is subtracted from the readings.
    stated : float
        Relative error stated for them.
    noise : float
        Relative standard error of `true` due to the light.
    extrapolated : float
        Relative change of the truth by the extrapolation from the finest elements.
    readings : float
        Number of taxels.
    within : float
        Number of these whose true error is within twice the stated error (and twice the noise).
    seconds : float
        Of processors' time.
    """

    case: str
    remark: str = ""
    elements: float = math.nan
    true: float = math.nan
    corrected: float = math.nan
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
    "corrected": "corrected",
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
    "corrected": ".3%",
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
