"""Measured readings and the settings that they belong to, from a CSV file."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.table import UNITS, as_parameter, ask_for_grams, read_table
from mitsuba_taxel.base.units import FORCES

READING = re.compile(r"(?P<kind>[vVpP])_?(?P<taxel>[1-9]\d*)(?P<error>_error)?")


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


def read_data(file: Path, known: Collection[str] = ()) -> Data:
    """Read a table with headings: settings such as ``fz`` or ``fz_mN``, readings of taxel 1 as ``v1_V`` or ``p1_W``,
    and their standard deviations as ``v1_error_V``, for all readings or for none; see
    `mitsuba_taxel.base.table.read_table`.

    Settings with a unit become those in mm, N, MPa, s and degrees, unless their heading is one of the ``known``
    parameters as it stands.

    Raises
    ------
    InputError
        if the file cannot be read, or is not such a table.
    """
    given = f"data {file.name!r}"
    readings: dict[int, np.ndarray] = {}
    errors: dict[int, np.ndarray] = {}
    settings, units = {}, set()
    table = read_table(f"data = {str(file)!r}", file, known)
    for column in table.columns:
        match = READING.fullmatch(column.name)
        if match is None:
            name, words = as_parameter(column)
            if not name or name in settings or not all(words):
                raise InputError(f"{given}, column {column.heading!r}: a distinct name and a value per row are needed.")
            settings[name] = words
            if name in FORCES and (numbers := as_numbers(words)):
                ask_for_grams(given, column, np.array(numbers))
            continue
        kind, factor = UNITS.get(column.unit, ("", "1"))
        if kind != ("V" if match["kind"] in "vV" else "W"):
            raise InputError(f"{given}, column {column.heading}: volts of v, and watts of p, are needed.")
        units.add(kind)
        into = errors if match["error"] else readings
        into[int(match["taxel"])] = float(factor) * table.numbers(column)
    if not table.lines:
        raise InputError(f"{given} is not allowed: a heading and at least one row are needed.")
    if not readings or len(units) > 1:
        raise InputError(f"{given} is not allowed: columns such as v1_V, or p1_W, of one kind are needed.")
    if errors and errors.keys() != readings.keys():
        raise InputError(f"{given} is not allowed: errors of all readings, or of none, are needed.")
    if any((one <= 0).any() for one in errors.values()):
        raise InputError(f"{given} is not allowed: errors above 0 are needed.")
    taxels = sorted(readings)

    def stacked(of: dict[int, np.ndarray]) -> np.ndarray:
        return np.stack([of[taxel] for taxel in taxels], axis=1)

    return Data(settings, units.pop(), np.array(taxels), stacked(readings), stacked(errors) if errors else None)
