"""Measured readings and the settings that they belong to, from a CSV file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.studies.plan.batch import columns_of

READING = re.compile(r"(?P<kind>[vp])(?P<taxel>[1-9]\d*)(?P<error>_error)?_(?P<unit>mV|V|W|mW|uW)")
FACTORS = {"V": 1.0, "mV": 1e-3, "W": 1.0, "mW": 1e-3, "uW": 1e-6}
SETTING_UNITS = re.compile(r"_(N|mm|MPa|W|degrees|nm|s)$")


@dataclass(frozen=True, eq=False)
class Data:
    """A table of measurements.

    Attributes
    ----------
    settings : dict[str, list[str]]
        Values of parameters of the scene, one for each row.
    unit : str
        ``V`` or ``W``.
    taxels : (taxels,) ndarray
        Numbers of the taxels.
    readings : (rows, taxels) ndarray
    errors : (rows, taxels) ndarray or None
        Standard deviations of the readings, if known.
    """

    settings: dict[str, list[str]]
    unit: str
    taxels: np.ndarray
    readings: np.ndarray
    errors: np.ndarray | None

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.readings)


def read_data(file: Path) -> Data:
    """Read a table with headings: settings such as ``fz`` or ``fz_N``, readings of taxel 1 as ``v1_V`` or ``p1_W``, and
    their standard deviations as ``v1_error_V``, for all readings or for none.

    Raises
    ------
    InputError
        if the file cannot be read, or is not such a table.
    """
    given = f"data {file.name!r}"
    columns = columns_of(file, "data")
    readings: dict[int, np.ndarray] = {}
    errors: dict[int, np.ndarray] = {}
    settings, units = {}, set()
    for name, words in columns.items():
        match = READING.fullmatch(name)
        if match is None:
            settings[SETTING_UNITS.sub("", name)] = words
            continue
        if (match["kind"] == "v") != match["unit"].endswith("V"):
            raise InputError(f"{given}, column {name}: volts of v, and watts of p, are needed.")
        units.add(match["unit"][-1])
        into = errors if match["error"] else readings
        into[int(match["taxel"])] = FACTORS[match["unit"]] * _numbers(words, name, given)
    if not readings or len(units) > 1:
        raise InputError(f"{given} is not allowed: columns such as v1_V, or p1_W, of one kind are needed.")
    if errors and errors.keys() != readings.keys():
        raise InputError(f"{given} is not allowed: errors of all readings, or of none, are needed.")
    if any((one <= 0).any() for one in errors.values()):
        raise InputError(f"{given} is not allowed: errors above 0 are needed.")
    taxels = sorted(readings)

    def table(of: dict[int, np.ndarray]) -> np.ndarray:
        return np.stack([of[taxel] for taxel in taxels], axis=1)

    return Data(settings, units.pop(), np.array(taxels), table(readings), table(errors) if errors else None)


def _numbers(words: list[str], name: str, given: str) -> np.ndarray:
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.array([np.nan])
    if not np.isfinite(numbers).all():
        raise InputError(f"{given}, column {name}: finite numbers are needed.")
    return numbers
