"""One row of the table of stated and true errors of readings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class CoverageRow:
    """Result of a setting; missing values are NaN.

    Attributes
    ----------
    case : str
        Name of the setting.
    remark : str
        Reason why the true or the stated error is missing; else empty.
    elements : float
        Number of elements of the pad.
    true : float
        Relative error of the reading of the worst taxel due to the finite elements.
    corrected : float
        True error after the signed error estimate is subtracted from the readings.
    stated : float
        Relative stated error of the worst taxel due to the finite elements.
    light : float
        Relative stated error of the light. It is nearly the same on all meshes, and no part of the comparison.
    extrapolated : float
        Relative change of the truth by the extrapolation from the finest elements.
    readings : float
        Number of taxels.
    within : float
        Number of taxels whose true error is within twice the stated error.
    seconds : float
        CPU time of all meshes.
    """

    COLUMNS: ClassVar = {
        "case": ("setting", ""),
        "elements": ("elements", ".0f"),
        "true": ("true", ".3%"),
        "corrected": ("corrected", ".3%"),
        "stated": ("stated", ".3%"),
        "ratio": ("true / stated", ".2f"),
        "light": ("light", ".3%"),
        "extrapolated": ("truth extrapolated by", ".3%"),
        "readings": ("readings", ".0f"),
        "within": ("within twice", ".0f"),
        "seconds": ("CPU s", ".0f"),
        "remark": ("remark", ""),
    }
    case: str
    remark: str = ""
    elements: float = math.nan
    true: float = math.nan
    corrected: float = math.nan
    stated: float = math.nan
    light: float = math.nan
    extrapolated: float = math.nan
    readings: float = math.nan
    within: float = math.nan
    seconds: float = math.nan

    @property
    def ratio(self) -> float:
        """True over stated error."""
        return self.true / self.stated if self.stated else math.inf
