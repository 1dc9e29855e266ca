"""Result class of `taxel bench light`: a reading without random numbers compared with random paths."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class LightRow:
    """Comparison of a reading at the default settings with a reading by random paths, for one configuration; missing
    values are NaN.

    Attributes
    ----------
    case : str
        Name of the configuration.
    random : str
        ``yes`` if the default reading needs random numbers, else ``no``.
    power : float
        Reading at the default settings, in W.
    off, stated : float
        Relative deviation of the reading from that by random paths, and its relative stated error.
    noise : float
        Relative stated error of the reading by random paths.
    slope_off, slope_stated, slope_noise : float
        Deviation, stated error, and noise of random paths, of the worst derivative; relative to the reading, per mm.
    seconds, tight_seconds : float
        CPU time in s of a reading at the default settings, and of a reading to a target error of 0.1 %.
    megabytes : float
        Peak memory of both readings, in MB.
    remark : str
        Reason why the configuration could not be read; else empty.
    measured : str
        Time of the measurement in UTC, which identifies the measured code.
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
        "measured": ("measured", ""),
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
    measured: str = ""

    @property
    def deviates(self) -> float:
        """Deviation divided by the combined error of both readings."""
        return _ratio(abs(self.off), math.hypot(self.stated, self.noise))

    @property
    def slope_deviates(self) -> float:
        """Deviation of the worst derivative divided by the combined error."""
        return _ratio(abs(self.slope_off), math.hypot(self.slope_stated, self.slope_noise))


def _ratio(deviation: float, error: float) -> float:
    return deviation / error if error else (0.0 if deviation == 0 else math.inf)
