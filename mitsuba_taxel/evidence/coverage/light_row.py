"""One row of the table of readings with and without random numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class LightRow:
    """Result of a configuration; missing values are NaN.

    Attributes
    ----------
    random : str
        ``no`` if the default reading needs no random numbers, ``yes`` if it does.
    power : float
        Reading at the default settings, in W.
    off, stated : float
        Its deviation from random paths, and the error that it states, relative.
    noise : float
        Stated error of the random paths, relative.
    slope_off, slope_stated, slope_noise : float
        The same of the worst derivative, relative to the reading per mm.
    seconds, tight_seconds : float
        Of processors' time at the default settings, and to 0.1 %.
    megabytes : float
        Peak memory of both.
    """

    COLUMNS: ClassVar = {
        "case": ("configuration", ""),
        "random": ("random paths", ""),
        "power": ("reading [W]", ".4g"),
        "off": ("deviation", ".3%"),
        "stated": ("stated", ".3%"),
        "noise": ("noise", ".3%"),
        "deviates": ("combined errors", ".2f"),
        "slope_off": ("slope deviation", ".2%"),
        "slope_stated": ("slope stated", ".2%"),
        "slope_noise": ("slope noise", ".2%"),
        "seconds": ("CPU s", ".1f"),
        "tight_seconds": ("CPU s to 0.1 %", ".1f"),
        "megabytes": ("MB", ".0f"),
        "remark": ("remark", ""),
    }
    case: str
    random: str = ""
    power: float = math.nan
    off: float = math.nan
    stated: float = math.nan
    noise: float = math.nan
    slope_off: float = math.nan
    slope_stated: float = math.nan
    slope_noise: float = math.nan
    seconds: float = math.nan
    tight_seconds: float = math.nan
    megabytes: float = math.nan
    remark: str = ""

    @property
    def deviates(self) -> float:
        """Deviation in combined errors of both."""
        return _ratio(abs(self.off), math.hypot(self.stated, self.noise))

    @property
    def slope_deviates(self) -> float:
        """The same of the worst derivative."""
        return _ratio(abs(self.slope_off), math.hypot(self.slope_stated, self.slope_noise))


def _ratio(deviation: float, error: float) -> float:
    return deviation / error if error else (0.0 if deviation == 0 else math.inf)
