"""Reflectance tabulated against wavelength."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.tables import read_columns

_NAME = "reflectance_table"


class ReflectanceTable:
    """Reflectance against wavelength from a CSV file, with linear interpolation.

    The file has two columns: wavelength in nm, finite, above 0 and increasing; reflectance from 0 to 1. Empty lines and
    text after a ``#`` are ignored. Its name is relative to the scene file.

    Parameters
    ----------
    file : str
        Name of the file.

    Raises
    ------
    InputError
        if the file cannot be read or has other contents.
    """

    parameter = _NAME
    """Parameter of the wall that states the reflectance."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.wavelengths, self.reflectances = read_columns(_NAME, file, fewest=1).T
        self._check()

    def at(self, nm: float) -> float:
        """Reflectance at a wavelength in nm.

        Raises
        ------
        InputError
            if the wavelength lies outside the table.
        """
        first, last = self.wavelengths[0], self.wavelengths[-1]
        if not first <= nm <= last:
            raise InputError(
                f"{_NAME} = {self.file!r} has no reflectance at the wavelength of {nm:g} nm: "
                f"it covers {first:g} to {last:g} nm; rows on both sides of it are needed."
            )
        return float(np.interp(nm, self.wavelengths, self.reflectances))

    def _check(self) -> None:
        """Raise `InputError` for the first row that is not allowed."""
        steps = np.diff(self.wavelengths, prepend=0.0)
        bad = ~(np.isfinite(self.wavelengths) & (steps > 0) & (self.reflectances >= 0) & (self.reflectances <= 1))
        if bad.any():
            row = int(np.argmax(bad))
            raise InputError(
                f"{_NAME} = {self.file!r}: row {row + 1}, {self.wavelengths[row]:g}, {self.reflectances[row]:g}, "
                "is not allowed: finite wavelengths in nm that increase and reflectances from 0 to 1 are needed."
            )
