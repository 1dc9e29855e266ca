"""Tables of numbers as people, machines and spreadsheets write them: one reader for all commands."""

from __future__ import annotations

import csv
import math
import re
import warnings
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.text import read_text

UNITS: dict[str, tuple[str, str]] = {
    "s": ("s", "1"), "ms": ("s", "1e-3"), "us": ("s", "1e-6"), "min": ("s", "60"),
    "N": ("N", "1"), "mN": ("N", "1e-3"), "uN": ("N", "1e-6"), "kN": ("N", "1e3"),
    "g": ("N", "9.80665e-3"), "gf": ("N", "9.80665e-3"), "kg": ("N", "9.80665"), "kgf": ("N", "9.80665"),
    "V": ("V", "1"), "mV": ("V", "1e-3"), "uV": ("V", "1e-6"),
    "W": ("W", "1"), "mW": ("W", "1e-3"), "uW": ("W", "1e-6"), "nW": ("W", "1e-9"),
    "mm": ("mm", "1"), "um": ("mm", "1e-3"), "cm": ("mm", "10"), "m": ("mm", "1e3"),
    "MPa": ("MPa", "1"), "kPa": ("MPa", "1e-3"), "Pa": ("MPa", "1e-6"), "bar": ("MPa", "0.1"),
    "degrees": ("degrees", "1"), "deg": ("degrees", "1"), "rad": ("degrees", repr(180 / math.pi)),
    "nm": ("nm", "1"),
    "A": ("A", "1"), "mA": ("A", "1e-3"), "uA": ("A", "1e-6"), "nA": ("A", "1e-9"),
    "counts": ("counts", "1"), "count": ("counts", "1"), "lsb": ("counts", "1"), "adc": ("counts", "1"),
}  # fmt: skip
"""By unit of a heading, the unit used here and the factor to it; grams and kilograms are forces of weights."""
_CASELESS = {unit.lower(): unit for unit in reversed(UNITS)}
WORDS = {"millis": ("time", "ms"), "micros": ("time", "us"), "milliseconds": ("time", "ms"), "seconds": ("time", "s")}
"""Headings that are a name and a unit in one, as of Arduino's clock."""
BY_UNDERSCORE = {*UNITS} - {"m", "g", "A", "bar", "rad", "min", "counts", "count", "lsb", "adc", "kg"}
"""Units that a heading of any name may end in after an underscore."""
LEAST_GRAMS = 50
"""Largest of round forces in N from which they may be weights in g."""
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars"}
_BRACKETED = re.compile(r"(?P<name>.*?)[ _]*(?:\[(?P<a>[^\]]*)\]|\((?P<b>[^)]*)\))")
_APPENDED = re.compile(r"(?P<name>.+?)(?:[ _]|\s*/\s*)(?P<unit>[^\s_/]+)")
_DIGITS = re.compile(r"[+-]?\d*")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    heading : str
        As it is written.
    name, unit : str
        The heading without its unit, and the unit, a key of `UNITS`, of its own or of a line of units below; empty
        if it has none.
    words : tuple[str, ...]
        Its entries, decimal commas replaced by points.
    """

    heading: str
    name: str
    unit: str
    words: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """A table with headings.

    Attributes
    ----------
    what : str
        The file, for messages.
    columns : tuple[Column, ...]
    lines : tuple[int, ...]
        Number of the line of each row in the file.
    separator : str
        That of the columns, in words.
    """

    what: str
    columns: tuple[Column, ...]
    lines: tuple[int, ...]
    separator: str

    def numbers(self, column: Column) -> np.ndarray:
        """(rows,) numbers of a column in its unit; raises `InputError` with line and heading."""
        values = np.empty(len(column.words))
        for row, word in enumerate(column.words):
            where = f"{self.what}, line {self.lines[row]}, column {column.heading}: {word!r}"
            try:
                values[row] = float(word)
            except ValueError:
                raise InputError(f"{where} is not a number.") from None
            if not math.isfinite(values[row]):
                raise InputError(f"{where} is not allowed: a finite number is needed.")
        return values


def read_table(what: str, file: Path, known: Collection[str] = ()) -> Table:
    """The table in a text file.

    Columns are separated by tabs, semicolons, commas, bars or blanks. Numbers have decimal points or, unless commas
    separate the columns, decimal commas. ``#`` begins a comment. The first line with as many fields as most lines has
    the headings; a line of units may follow. Units are in brackets, or appended by ``_``, a blank or ``/``.

    Parameters
    ----------
    what : str
        The file, for messages.
    file : Path
        Text in UTF-8.
    known : Collection[str], optional
        Headings that are names as they stand, such as parameters of a scene.

    Returns
    -------
    Table
        Its columns, with their headings and units.

    Raises
    ------
    InputError
        if it cannot be read, or is ambiguous; the message states what was found and what is needed.
    """
    text = [line.split("#")[0].rstrip() for line in read_text(what, file).splitlines()]
    lines = [(number, line) for number, line in enumerate(text, start=1) if line.strip()]
    if lines and re.fullmatch(r"sep=.", lines[0][1].strip()):
        lines = lines[1:]  # for spreadsheets
    mark, rows = separated(what, [line for _, line in lines])
    shown = SEPARATORS.get(mark, "blanks")
    count = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    first = next((number for number, row in enumerate(rows) if len(row) == count), 0)
    if mark == "," and rows and 1 < len(rows[0]) < count and all(map(_DIGITS.fullmatch, rows[first])):
        raise InputError(
            f"{what} is ambiguous: it has {len(rows[0])} headings and {count} values in a row, as if commas were both "
            "separators and decimal marks; decimal points, or semicolons between columns, are needed."
        )
    head, body = (rows[first], rows[first + 1 :]) if rows else ([], [])
    numbers = [number for number, _ in lines[first + 1 :]]
    units = [""] * len(head)
    if body and len(body[0]) == len(head) and any(body[0]) and all(_unit_line(word) is not None for word in body[0]):
        units, body, numbers = [_unit_line(word) or "" for word in body[0]], body[1:], numbers[1:]
    for number, row in zip(numbers, body, strict=True):
        if len(row) != len(head):
            raise InputError(
                f"{what}, line {number}: {len(row)} values are not allowed: {len(head)} are needed, one per column "
                f"(columns are separated by {shown})."
            )
    columns = []
    for place, (heading, unit) in enumerate(zip(head, units, strict=True)):
        name, own = (heading, "") if heading in known else _named(heading)
        words = [row[place] for row in body]
        words = words if mark == "," else _with_points(what, heading, words)
        columns.append(Column(heading, name, own or unit, tuple(words)))
    return Table(what, tuple(columns), tuple(numbers), shown)


def as_parameter(column: Column) -> tuple[str, list[str]]:
    """Name and values of a column of parameters of a scene, in mm, N, MPa, s and degrees.

    Parameters
    ----------
    column : Column
        With its heading and unit.

    Returns
    -------
    name : str
        Of the parameter.
    words : list[str]
        Its values, row by row.
    """
    if not column.unit or (column.unit not in BY_UNDERSCORE and column.heading.endswith(f"_{column.unit}")):
        return column.heading, list(column.words)
    factor = Decimal(UNITS[column.unit][1])
    words = []
    for word in column.words:
        try:
            words.append(word if factor == 1 else f"{(Decimal(word) * factor).normalize():f}")
        except ArithmeticError:  # none, say
            words.append(word)
    return column.name, words


def ask_for_grams(what: str, column: Column, numbers: np.ndarray) -> None:
    """Warn of forces in N (rows,) that look like weights in g: several round ones, the largest of 50 or more.

    Parameters
    ----------
    what : str
        What the table is, for the warning.
    column : Column
        With its heading and unit.
    numbers : (rows,) ndarray
        Its values, N.
    """
    levels = np.unique(np.abs(numbers[numbers != 0]))
    if column.unit in ("N", "") and len(levels) > 2 and levels[-1] >= LEAST_GRAMS and not (levels % 10).any():
        warnings.warn(
            f"{what}, column {column.heading}: round forces up to {levels[-1]:g} N: if these are weights in g, 9.8 mN "
            f"each, '{column.name} [g]' is needed as heading.",
            stacklevel=2,
        )


def separated(what: str, lines: list[str]) -> tuple[str, list[list[str]]]:
    """The separator of the columns of a table, and the fields of each line.

    Of the separators that cut most lines alike the first counts.

    Parameters
    ----------
    what : str
        What the table is, for messages.
    lines : list[str]
        Of its text.

    Returns
    -------
    mark : str
        A separator; a blank for any white space, empty for a single column.
    rows : list[list[str]]
        Fields of each line.

    Raises
    ------
    InputError
        if a quoted field does not end.
    """
    best: tuple[int, str, list[list[str]]] = (0, "", [[line.strip()] for line in lines])
    if len(lines) > 1 and "," not in lines[0] and all(re.fullmatch(r"\s*[+-]?\d+,\d+\s*", line) for line in lines[1:]):
        return best[1], best[2]  # one column with decimal commas
    for mark in SEPARATORS:
        try:
            rows = [[word.strip() for word in row] for row in csv.reader(lines, delimiter=mark)]
        except csv.Error as error:
            raise InputError(f"{what} is not a table: {error}.") from error
        counts = Counter(len(row) for row in rows if len(row) > 1)
        alike = max(counts.values(), default=0)
        if alike > best[0]:
            best = alike, mark, rows
    if best[0] <= len(lines) / 2:
        for blank in (r"\s+", r"\s{2,}"):  # the latter for headings of several words
            blanks = [re.split(blank, line.strip()) for line in lines]
            if lines and len({len(row) for row in blanks}) == 1 and len(blanks[0]) > 1:
                return " ", blanks
        if len(lines) > 2 and best[0] <= 1:
            return "", [[line.strip()] for line in lines]
    return best[1], best[2]


def _unit_line(word: str) -> str | None:
    """The unit that a word of a line of units is; empty for none, None if it is no unit."""
    bare = word.strip("()[]").strip()
    return "" if bare in ("", "-", "1") and not bare.isdigit() else _unit(bare)


def _unit(word: str) -> str | None:
    word = word.strip().replace("µ", "u").replace("μ", "u").replace("°", "deg")
    return word if word in UNITS else _CASELESS.get(word.lower())


def _named(heading: str) -> tuple[str, str]:
    """The name and the unit of a heading."""
    if heading.lower() in WORDS:
        return WORDS[heading.lower()]
    bracketed = _BRACKETED.fullmatch(heading)
    if bracketed and (unit := _unit(bracketed["a"] or bracketed["b"] or "")):
        return bracketed["name"].strip() or heading, unit
    appended = _APPENDED.fullmatch(heading)
    if appended and (unit := _unit(appended["unit"])):
        return appended["name"].strip(), unit
    return heading, ""


def _with_points(what: str, heading: str, words: list[str]) -> list[str]:
    """Entries with decimal points in place of commas; raises `InputError` if commas may mean thousands."""
    commas = [word for word in words if "," in word and re.fullmatch(r"[+-]?[\d.,]+(?:[eE][+-]?\d+)?", word)]
    if not commas:
        return words
    mixed = [word for word in words if "." in word and re.fullmatch(r"[+-]?[\d.,]+(?:[eE][+-]?\d+)?", word)]
    several = [word for word in commas if word.count(",") > 1 or "." in word]
    thousands = all(map(_THOUSANDS.fullmatch, commas)) and any(re.fullmatch(r"[+-]?\d{1,3}", word) for word in words)
    if mixed or several or thousands:
        example = (several or commas)[0]
        raise InputError(f"{what}, column {heading}: {example!r} is ambiguous: one decimal mark, a point, is needed.")
    return [word.replace(",", ".") if word in set(commas) else word for word in words]
