"""Tables of current over the distance of a reflector."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.arguments import is_number, path_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.table import UNITS, Column, Table, read_table

LEAST_ROWS = 5
"""Least number of rows of a curve."""
_CURRENTS = ("A", "V", "W", "counts")
"""Units of readings that may be proportional to the light; the constant of proportionality is fitted."""


@dataclass(frozen=True, eq=False)
class DistanceCurve:
    """A measured curve of current over distance, with N rows.

    Attributes
    ----------
    file : str
        Name of the file.
    heights : (N,) ndarray
        Height of the reflector above the windows, mm.
    currents : (N,) ndarray
        Current, relative to the largest.
    """

    file: str
    heights: np.ndarray
    currents: np.ndarray


def read_distances(file: str | Path, zero: float = 0.0) -> DistanceCurve:
    """Read a curve of current over distance from a text file.

    Parameters
    ----------
    file : str or Path
        Table with a column of distances, such as ``distance [mm]``, and one of currents, such as ``current [mA]``,
        ``reading [V]`` or ``current`` relative to any current.
    zero : float
        Height above the windows of the plane from which distances are counted, such as the rim of a housing, mm.

    Returns
    -------
    DistanceCurve
        The curve.

    Raises
    ------
    InputError
        if the table is not such a curve; the message names the line.
    """
    if not is_number(zero) or not zero >= 0:
        raise InputError(f"zero = {zero!r} is not allowed: a number of mm of at least 0 is needed.")
    path = path_of("curve", file)
    what = f"curve {path.name}"
    table = read_table(what, path)
    if len(table.columns) != 2:
        raise InputError(f"{what} has {len(table.columns)} columns: one of distances and one of currents are needed.")
    is_distance = [UNITS.get(column.unit, ("",))[0] == "mm" for column in table.columns]
    if sum(is_distance) != 1:
        headings = ", ".join(column.heading for column in table.columns)
        raise InputError(
            f"{what}: of the columns {headings}, exactly one must have a unit of length, such as `distance [mm]`."
        )
    distance, current = sorted(table.columns, key=lambda column: not is_distance[table.columns.index(column)])
    unit = UNITS.get(current.unit, ("",))[0]
    if current.unit and unit not in _CURRENTS:
        raise InputError(
            f"{what}: the unit {current.unit} of column {current.heading} is not allowed: A, V, W, counts, or none for "
            "relative currents is needed."
        )
    if len(table.lines) < LEAST_ROWS:
        raise InputError(f"{what} has {len(table.lines)} rows: at least {LEAST_ROWS} are needed.")
    heights = _distances(table, distance) + zero
    currents = table.numbers(current)
    _check_rows(what, table.lines, heights, currents)
    return DistanceCurve(path.name, heights, currents / currents.max())


def _distances(table: Table, column: Column) -> np.ndarray:
    """Distances (N,) in mm."""
    return table.numbers(column) * float(UNITS[column.unit][1])


def _check_rows(what: str, lines: tuple[int, ...], heights: np.ndarray, currents: np.ndarray) -> None:
    """Raise `InputError`, with the line, for rows that no curve of a reflector has."""
    for row, line in enumerate(lines):
        if row and heights[row] < heights[row - 1]:
            raise InputError(
                f"{what}, line {line}: the distance falls from {heights[row - 1]:g} to {heights[row]:g} mm above the "
                "windows; distances that rise from row to row are needed."
            )
        if not heights[row] > 0:
            raise InputError(
                f"{what}, line {line}: the reflector is {heights[row]:g} mm above the windows, which is not allowed: "
                "more than 0 mm is needed; --zero says how far above the windows distances begin."
            )
        if currents[row] < 0:
            raise InputError(
                f"{what}, line {line}: the current {currents[row]:g} is negative; currents of at least 0, with the "
                "current in the dark subtracted, are needed."
            )
    if not currents.max() > 0:
        raise InputError(f"{what} has no current above 0: a column with the current of the phototransistor is needed.")
    if heights[0] == heights[-1]:
        raise InputError(f"{what} has one distance only: several are needed.")
