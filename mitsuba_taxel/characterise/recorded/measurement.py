"""Measured force and voltages from a CSV file."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.table import UNITS, Column, ask_for_grams, read_table

FEWEST_ROWS = 10
NAMES = {
    "t": "time", "time": "time", "timestamp": "time", "f": "force", "force": "force", "load": "force",
    "weight": "force",
    "fx": "fx", "fy": "fy", "fz": "fz", "forcex": "fx", "forcey": "fy", "forcez": "fz",
}  # fmt: skip
"""Quantities by heading, in small letters and without blanks."""
_VOLTAGE = re.compile(r"(?:v|voltage|u|ch|channel|taxel)[ _]*(?P<taxel>\d+)?")
FORCE_COLUMNS = ({"force"}, {"fx"}, {"fy"}, {"fz"}, {"fx", "fy", "fz"})


@dataclass(frozen=True, eq=False)
class Measurement:
    """A record of force and voltages from a test bench.

    Attributes
    ----------
    time : (rows,) ndarray or None
        Times in s; None if the record has no column of time.
    force : (rows, 1 or 3) ndarray
        Force in N: one column, or three components.
    force_names : tuple[str, ...]
        Names of the columns of ``force``.
    voltage : (rows, taxels) ndarray
        Voltages in V.
    taxel : (taxels,) ndarray
        Numbers of the taxels.
    file : str
        Name of the file, for messages.
    """

    time: np.ndarray | None
    force: np.ndarray
    force_names: tuple[str, ...]
    voltage: np.ndarray
    taxel: np.ndarray
    file: str


def read_measurement(file: str | Path) -> Measurement:
    """Read a table of time, force and one voltage per taxel: ``time_s,force_N,v1_V,v2_V``; see
    `mitsuba_taxel.base.files.table.read_table`.

    A heading is a name and a unit, such as ``v1_V``, ``v1 [V]`` or ``v1 (V)``; the units may also stand on a separate
    line. Names are case-insensitive. Columns may be in any order:

    - ``time`` or ``t`` in s or ms, or ``millis``, rising from row to row; without it, rows are in the order of the
      record;
    - ``force`` or ``f``, or ``fx``, ``fy`` or ``fz``, or all three components, in N, mN, kN, g or kg of weight;
    - ``v1``, ``v2``, ... or ``voltage1``, ... in V or mV, with the number of the taxel.

    Parameters
    ----------
    file : str or Path
        A text file.

    Returns
    -------
    Measurement
        The record, converted to s, N and V.

    Raises
    ------
    InputError
        if the file cannot be read, a heading is unknown, or a number is missing, not finite or out of order; the
        message names the line of the file and the column.
    """

    def refuse(problem: str) -> NoReturn:
        raise InputError(f"measurement {str(file)!r}{problem}")

    table = read_table(f"measurement {str(file)!r}", Path(file))
    headings = [column.heading for column in table.columns]
    if not any(map(str.isalpha, "".join(headings))):
        refuse(" has no headings: a first line such as time_s,force_N,v1_V,v2_V is needed.")

    # The quantity of each column: time, a force or the number of a taxel.
    volts = [column for column in table.columns if _VOLTAGE.fullmatch(column.name.lower())]
    names = [_quantity(column, len(volts), refuse) for column in table.columns]
    forces = tuple(sorted(name for name in names if not isinstance(name, int) and name != "time"))
    taxels = sorted(name for name in names if isinstance(name, int))
    shown = f"{', '.join(headings)} (separated by {table.separator})"
    if len(set(names)) < len(names):
        refuse(f": columns {shown} are not allowed: each quantity must occur once.")
    if set(forces) not in FORCE_COLUMNS or not taxels:
        refuse(f": columns {shown} are not enough: force_N (or fx_N, fy_N, fz_N) and v1_V, ... are needed.")
    if len(table.lines) < FEWEST_ROWS:
        refuse(f" has {len(table.lines)} rows of numbers: at least {FEWEST_ROWS} are needed.")

    # Time rises from row to row; forces are converted into N and voltages into V.
    data = np.stack([table.numbers(column) for column in table.columns], axis=1)
    if "time" in names:
        clock = names.index("time")
        late = np.flatnonzero(np.diff(data[:, clock]) <= 0)
        if len(late):
            refuse(f", line {table.lines[late[0] + 1]}: {headings[clock]} must be greater than in the row before.")
    for name, column, numbers in zip(names, table.columns, data.T, strict=True):
        if forces == (name,):
            ask_for_grams(f"measurement {str(file)!r}", column, numbers)
    data *= [float(UNITS[column.unit][1]) for column in table.columns]
    of = {name: data[:, number] for number, name in enumerate(names)}
    return Measurement(
        of.get("time"),
        np.stack([of[name] for name in forces], axis=1),
        forces,
        np.stack([of[taxel] for taxel in taxels], axis=1),
        np.array(taxels),
        str(file),
    )


def _quantity(column: Column, voltages: int, refuse: Callable[[str], NoReturn]) -> str | int:
    """The quantity of a column: ``time``, the name of a force, or the number of a taxel."""
    bare = re.sub(r"[ _]", "", column.name.lower())
    voltage = _VOLTAGE.fullmatch(column.name.lower())
    name: str | int = NAMES.get(bare, "")
    if voltage and (voltage["taxel"] or voltages == 1):
        name = int(voltage["taxel"] or 1)
    needed = {"time": "s", "": ""}.get(name, "N") if isinstance(name, str) else "V"
    kind = UNITS[column.unit][0] if column.unit else ""
    if name != "" and kind == needed:
        return name
    if name != "" and kind == "counts":
        refuse(
            f": column {column.heading!r} contains counts of a converter: volts are needed, which are counts times "
            f"the full scale, divided by 2^bits."
        )
    if name != "" and kind == "A":
        refuse(
            f": column {column.heading!r} contains a current: volts are needed, which are the current times the "
            f"load resistance."
        )
    if name != "":
        of = f"in {column.unit}" if column.unit else "without a unit"
        unit = {"s": "s or ms", "N": "N, mN, kN or g", "V": "V or mV"}[needed]
        refuse(f": column {column.heading!r} is {of}: {unit} is needed, as in {column.name}_{needed}.")
    refuse(
        f": column {column.heading!r} is not known: allowed are time_s, force_N, fx_N, fy_N, fz_N and v1_V, v2_V, ..."
    )
