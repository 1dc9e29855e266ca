"""Result class of `taxel bench coverage`: stated and true error of the readings of one setting."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class CoverageRow:
    """Stated and true error of the readings of one setting; missing values are NaN.

    Attributes
    ----------
    case : str
        Name of the setting.
    remark : str
        Reason why the true or the stated error is missing; else empty.
    elements : float
        Number of elements of the pad.
    true : float
        True relative error of the reading of the worst taxel due to the finite elements.
    corrected : float
        The same after the error estimate, with its sign, is subtracted from the readings.
    stated : float
        Stated relative error of the reading of the worst taxel due to the finite elements.
    light : float
        Stated relative error of the light. It is nearly the same on all meshes, and is not part of the comparison.
    extrapolated : float
        Relative change of the reference value by its extrapolation from the finest elements.
    readings : float
        Number of taxels.
    within : float
        Number of taxels whose true error is at most twice the stated error.
    seconds : float
        CPU time of the readings on all meshes, in s.
    """

    COLUMNS: ClassVar = {
        "case": ("setting", ""),
        "elements": ("elements", ".0f"),
        "true": ("true", ".3%"),
        "corrected": ("corrected", ".3%"),
        "stated": ("stated", ".3%"),
        "ratio": ("true / stated", ".2f"),
        "light": ("light", ".3%"),
        "extrapolated": ("extrapolation", ".3%"),
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
        """True error divided by stated error."""
        return self.true / self.stated if self.stated else math.inf


def summary(rows: Sequence[CoverageRow]) -> str:
    """Summarise rows: the number of readings within twice their stated error, and the root mean square errors."""
    read = [row for row in rows if row.within == row.within]
    readings, within = sum(row.readings for row in read), sum(row.within for row in read)
    unread = f"; {len(rows) - len(read)} settings could not be read" if len(read) < len(rows) else ""
    percentage = f" ({within / readings:.1%})" if readings else ""
    true, corrected = (root_mean_square([getattr(row, name) for row in read]) for name in ("true", "corrected"))
    return (
        f"{within:.0f} of {readings:.0f} readings{percentage} in {len(read)} settings are within twice the stated "
        f"error{unread}. Root mean square over the settings, of the worst taxel of each: true {true:.3%}, corrected "
        f"{corrected:.3%} (columns below)."
    )


def root_mean_square(values: Sequence[float]) -> float:
    return math.sqrt(sum(value**2 for value in values) / len(values)) if values else math.nan
