"""Measured readings and their settings, from a CSV file."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.table import UNITS, as_parameter, ask_for_grams, read_table
from mitsuba_taxel.base.units import FORCES

READING = re.compile(r"(?P<kind>[vVpP])_?(?P<taxel>[1-9]\d*)(?P<error>_error)?")


@dataclass(frozen=True, eq=False)
class MeasuredData:
    """Measured readings of a sensor, and the settings at which they were measured.

    Attributes
    ----------
    settings : dict[str, list[str]]
        Values of parameters of the scene, one for each row of the table.
    unit : str
        Unit of the readings, ``V`` or ``W``.
    taxels : (taxels,) ndarray
        Numbers of the taxels.
    readings : (rows, taxels) ndarray
        Measured readings.
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
        """Number of rows of measurements."""
        return len(self.readings)


def read_data(file: Path, parameters: Collection[str] = ()) -> MeasuredData:
    """Read measured readings, and the settings at which they were measured, from a CSV file.

    Headings are settings such as ``fz`` or ``fz_mN``, readings such as ``v1_V`` or ``p1_W`` of taxel 1, and standard
    deviations such as ``v1_error_V``, either for all readings or for none; see
    `mitsuba_taxel.base.files.table.read_table`. Settings with a unit are converted to mm, N, MPa, s and degrees, unless
    the whole heading is the name of a parameter.

    Parameters
    ----------
    file : Path
        CSV file.
    parameters : Collection[str]
        Names of the scene's parameters.

    Raises
    ------
    InputError
        if the file cannot be read, or is not a table of measurements.
    """
    # Columns of settings, readings and errors.
    label = f"data {file.name!r}"
    readings: dict[int, np.ndarray] = {}
    errors: dict[int, np.ndarray] = {}
    settings, units = {}, set()
    table = read_table(f"data = {str(file)!r}", file, parameters)
    for column in table.columns:
        match = READING.fullmatch(column.name)
        if match is None:
            name, words = as_parameter(column)
            if not name or name in settings or not all(words):
                raise InputError(
                    f"{label}, column {column.heading!r}: a value in each row, and a name that no other column has, "
                    "are needed."
                )
            settings[name] = words
            if name in FORCES and (numbers := as_numbers(words)):
                ask_for_grams(label, column, np.array(numbers))
            continue
        kind, factor = UNITS.get(column.unit, ("", "1"))
        if kind != ("V" if match["kind"] in "vV" else "W"):
            raise InputError(
                f"{label}, column {column.heading}: volts for v1, v2, ..., and watts for p1, p2, ..., are needed."
            )
        units.add(kind)
        into = errors if match["error"] else readings
        into[int(match["taxel"])] = float(factor) * table.numbers(column)

    # Conditions on the columns together.
    if not table.lines:
        raise InputError(f"{label} is not allowed: a heading and at least one row are needed.")
    if not readings or len(units) > 1:
        raise InputError(
            f"{label} is not allowed: columns of readings are needed, all in volts (v1_V, ...) or all "
            f"in watts (p1_W, ...)."
        )
    if errors and errors.keys() != readings.keys():
        raise InputError(f"{label} is not allowed: errors of all readings, or of none, are needed.")
    if any((deviations <= 0).any() for deviations in errors.values()):
        raise InputError(f"{label} is not allowed: errors above 0 are needed.")
    taxels = sorted(readings)

    def stacked(of: dict[int, np.ndarray]) -> np.ndarray:
        return np.stack([of[taxel] for taxel in taxels], axis=1)

    return MeasuredData(settings, units.pop(), np.array(taxels), stacked(readings), stacked(errors) if errors else None)
