"""Measured force and voltages from a CSV file."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.text import read_text

FEWEST_ROWS = 10
FACTORS = {"s": 1.0, "ms": 1e-3, "n": 1.0, "mn": 1e-3, "v": 1.0, "mv": 1e-3}
HEADING = re.compile(
    r"(?P<name>t|time|f|force|fx|fy|fz|(?:v|voltage)_?(?P<taxel>\d+))[_ ]*[(\[]?(?P<unit>m?[snv])[)\]]?"
)
FORCE_COLUMNS = ({"force"}, {"fx"}, {"fy"}, {"fz"}, {"fx", "fy", "fz"})


@dataclass(frozen=True, eq=False)
class Measurement:
    """A record of a bench.

    ``time`` (rows,) in s; ``force`` (rows, 1 or 3) in N, its columns named by ``force_names``; ``voltage``
    (rows, taxels) in V; ``taxel`` (taxels,) their numbers; ``file`` where it comes from, for messages.
    """

    time: np.ndarray
    force: np.ndarray
    force_names: tuple[str, ...]
    voltage: np.ndarray
    taxel: np.ndarray
    file: str


def read_measurement(file: str | Path) -> Measurement:
    """Read a table of time, force and one voltage per taxel: ``time_s,force_N,v1_V,v2_V``.

    The first line has the headings; ``#`` starts a comment. Every heading is a name and a unit, such as ``v1_V``, ``v1
    [V]`` or ``v1 (V)``, case-insensitive, in any order:

    - ``time`` or ``t`` in s or ms, rising from row to row;
    - ``force`` or ``f``, or one of ``fx``, ``fy``, ``fz``, or all three of these, in N or mN;
    - ``v1``, ``v2``, ... or ``voltage1``, ... in V or mV, with the number of the taxel.

    Raises
    ------
    InputError
        if the file cannot be read, a heading is none of these, or a number is missing, not finite or out of order;
        the message names the line of the file and the column.
    """

    def refuse(problem: str) -> NoReturn:
        raise InputError(f"measurement {str(file)!r}{problem}")

    text = read_text(f"measurement {str(file)!r}", Path(file))
    lines = [(number, line.split("#")[0].strip()) for number, line in enumerate(text.splitlines(), start=1)]
    numbers = [number for number, line in lines if line]
    try:
        head, *rows = [[word.strip() for word in row] for row in csv.reader(line for _, line in lines if line)] or [[]]
    except csv.Error as error:
        refuse(f" is not a CSV file: {error}.")
    if not any(map(str.isalpha, "".join(head))):
        refuse(" has no headings: a first line such as time_s,force_N,v1_V,v2_V is needed.")
    columns = [_column(word, refuse) for word in head]
    names = [name for name, _ in columns]
    forces = tuple(sorted(name for name in names if not isinstance(name, int) and name != "time"))
    taxels = sorted(name for name in names if isinstance(name, int))
    if len(set(names)) < len(names):
        refuse(f": columns {', '.join(head)} are not allowed: each must occur once.")
    if "time" not in names or set(forces) not in FORCE_COLUMNS or not taxels:
        refuse(
            f": columns {', '.join(head)} are not enough: time_s, force_N (or fx_N, fy_N, fz_N), v1_V, ... are needed."
        )
    if len(rows) < FEWEST_ROWS:
        refuse(f" holds {len(rows)} rows of numbers: at least {FEWEST_ROWS} are needed.")
    data = np.empty((len(rows), len(head)))
    for row, number in enumerate(numbers[1:]):
        data[row] = _numbers(rows[row], head, number, refuse)
    late = np.flatnonzero(np.diff(data[:, names.index("time")]) <= 0)
    if len(late):
        refuse(f", line {numbers[late[0] + 2]}: {head[names.index('time')]} does not rise from the row before.")
    data *= [factor for _, factor in columns]
    of = {name: data[:, number] for number, name in enumerate(names)}
    return Measurement(
        of["time"],
        np.stack([of[name] for name in forces], axis=1),
        forces,
        np.stack([of[taxel] for taxel in taxels], axis=1),
        np.array(taxels),
        str(file),
    )


def _column(heading: str, refuse: Callable[[str], NoReturn]) -> tuple[str | int, float]:
    """``time``, a force's name or a taxel's number, and the factor to s, N or V."""
    match = HEADING.fullmatch(heading.lower())
    if match is not None:
        unit, taxel = match["unit"], match["taxel"]
        name: str | int = int(taxel) if taxel else {"t": "time", "f": "force"}.get(match["name"], match["name"])
        if unit[-1] == ("v" if taxel else "s" if name == "time" else "n"):
            return name, FACTORS[unit]
    refuse(f": column {heading!r} is not known: time_s, force_N, fx_N, fy_N, fz_N or v1_V, v2_V, ... are.")


def _numbers(words: list[str], head: list[str], line: int, refuse: Callable[[str], NoReturn]) -> list[float]:
    if len(words) != len(head):
        refuse(f", line {line}: {len(words)} values are not allowed: {len(head)} are needed, one per column.")
    numbers = []
    for word, heading in zip(words, head, strict=True):
        try:
            number = float(word)
        except ValueError:
            refuse(f", line {line}, column {heading}: {word!r} is not a number.")
        if not math.isfinite(number):
            refuse(f", line {line}, column {heading}: {word!r} is not allowed: a finite number is needed.")
        numbers.append(number)
    return numbers
