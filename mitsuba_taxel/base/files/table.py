"""Reading of tables of numbers, as written by people, instruments and spreadsheets."""

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
"""For each unit of a heading, the unit of this package and the conversion factor; grams and kilograms are weights, so
forces."""
_CASELESS = {unit.lower(): unit for unit in reversed(UNITS)}
WORDS = {"millis": ("time", "ms"), "micros": ("time", "us"), "milliseconds": ("time", "ms"), "seconds": ("time", "s")}
"""Name and unit of headings that imply a unit, such as those of the clock of an Arduino."""
BY_UNDERSCORE = {*UNITS} - {"m", "g", "A", "bar", "rad", "min", "counts", "count", "lsb", "adc", "kg"}
"""Units that may follow any name after an underscore."""
LEAST_GRAMS = 50
"""Largest force, in N, from which forces in whole numbers may be weights in g."""
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars"}
_BRACKETED = re.compile(r"(?P<name>.*?)[ _]*(?:\[(?P<a>[^\]]*)\]|\((?P<b>[^)]*)\))")
_APPENDED = re.compile(r"(?P<name>.+?)(?:[ _]|\s*/\s*)(?P<unit>[^\s_/]+)")
_DIGITS = re.compile(r"[+-]?\d*")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")


@dataclass(frozen=True)
class Column:
    """A column of a `Table`.

    Attributes
    ----------
    heading : str
        Heading in the file.
    name, unit : str
        Heading without its unit, and the unit, as a key of `UNITS`. The unit is from the heading or from a line of
        units; it is empty if there is none.
    words : tuple[str, ...]
        Entries, with decimal commas replaced by points.
    """

    heading: str
    name: str
    unit: str
    words: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """A table from a text file, with its headings and units.

    Attributes
    ----------
    what : str
        Description of the file, for messages.
    columns : tuple[Column, ...]
        Columns in the order of the file.
    lines : tuple[int, ...]
        Line number of each row in the file.
    separator : str
        Description of the separator of columns.
    """

    what: str
    columns: tuple[Column, ...]
    lines: tuple[int, ...]
    separator: str

    def numbers(self, column: Column) -> np.ndarray:
        """Numbers (rows,) of a column in its unit; raises `InputError`, with line and heading, for other entries."""
        values = np.empty(len(column.words))
        for row, word in enumerate(column.words):
            where = f"{self.what}, line {self.lines[row]}, column {column.heading}: {word!r}"
            try:
                values[row] = float(word)
            except ValueError:
                raise InputError(f"{where} is not allowed: a number is needed.") from None
            if not math.isfinite(values[row]):
                raise InputError(f"{where} is not allowed: a finite number is needed.")
        return values


def read_table(what: str, file: Path, known: Collection[str] = ()) -> Table:
    """Read a table of numbers from a text file, such as a CSV file of a spreadsheet or an instrument.

    Columns are separated by tabs, semicolons, commas, bars or blanks. Numbers have decimal points or, unless commas
    separate the columns, decimal commas. ``#`` begins a comment. The first line with as many fields as most lines
    contains the headings; a line of units may follow. Units are in brackets, or appended by ``_``, a blank or ``/``.

    Parameters
    ----------
    what : str
        Description of the file, for messages.
    file : Path
        A text file in UTF-8.
    known : Collection[str], optional
        Headings without a unit, such as names of parameters of a scene.

    Returns
    -------
    Table
        Columns with their headings and units.

    Raises
    ------
    InputError
        if the file cannot be read, or is ambiguous; the message describes the problem and what is needed.
    """
    # Lines without comments, and their fields.
    text = [line.split("#")[0].rstrip() for line in read_text(what, file).splitlines()]
    lines = [(number, line) for number, line in enumerate(text, start=1) if line.strip()]
    if lines and re.fullmatch(r"sep=.", lines[0][1].strip()):
        lines = lines[1:]  # a line from which spreadsheets read the separator
    separator, rows = separated(what, [line for _, line in lines])
    separator_name = SEPARATORS.get(separator, "blanks")

    # Headings are in the first line of the usual length; a line of units may follow.
    count = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    first = next((number for number, row in enumerate(rows) if len(row) == count), 0)
    if separator == "," and rows and 1 < len(rows[0]) < count and all(map(_DIGITS.fullmatch, rows[first])):
        raise InputError(
            f"{what} is ambiguous: it has {len(rows[0])} headings and {count} values in a row, as if commas were both "
            "separators and decimal marks; decimal points, or semicolons between columns, are needed."
        )
    head, body = (rows[first], rows[first + 1 :]) if rows else ([], [])
    numbers = [number for number, _ in lines[first + 1 :]]
    units = [""] * len(head)
    if body and len(body[0]) == len(head) and any(body[0]) and all(_unit_line(word) is not None for word in body[0]):
        units, body, numbers = [_unit_line(word) or "" for word in body[0]], body[1:], numbers[1:]

    # All rows have a value for each column.
    for number, row in zip(numbers, body, strict=True):
        if len(row) != len(head):
            raise InputError(
                f"{what}, line {number}: {len(row)} values are not allowed: {len(head)} are needed, one per column "
                f"(columns are separated by {separator_name})."
            )
    columns = []
    for index, (heading, unit) in enumerate(zip(head, units, strict=True)):
        name, own_unit = (heading, "") if heading in known else _named(heading)
        words = [row[index] for row in body]
        words = words if separator == "," else _with_points(what, heading, words)
        columns.append(Column(heading, name, own_unit or unit, tuple(words)))
    return Table(what, tuple(columns), tuple(numbers), separator_name)


def as_parameter(column: Column) -> tuple[str, list[str]]:
    """Convert a column to values of a parameter of a scene, in mm, N, MPa, s and degrees.

    Parameters
    ----------
    column : Column
        Column with its heading and unit.

    Returns
    -------
    name : str
        Name of the parameter.
    words : list[str]
        Values of the rows.
    """
    if not column.unit or (column.unit not in BY_UNDERSCORE and column.heading.endswith(f"_{column.unit}")):
        return column.heading, list(column.words)
    factor = Decimal(UNITS[column.unit][1])
    words = []
    for word in column.words:
        try:
            words.append(word if factor == 1 else f"{(Decimal(word) * factor).normalize():f}")
        except ArithmeticError:  # a word such as none
            words.append(word)
    return column.name, words


def ask_for_grams(what: str, column: Column, numbers: np.ndarray) -> None:
    """Warn if forces in N are probably weights in g: if they are several whole numbers, the largest at least 50.

    Parameters
    ----------
    what : str
        Description of the table, for the warning.
    column : Column
        Column with its heading and unit.
    numbers : (rows,) ndarray
        Values of the column, in N.
    """
    levels = np.unique(np.abs(numbers[numbers != 0]))
    if column.unit in ("N", "") and len(levels) > 2 and levels[-1] >= LEAST_GRAMS and not (levels % 1).any():
        warnings.warn(
            f"{what}, column {column.heading}: forces are whole numbers up to {levels[-1]:g} N: if these are weights "
            f"in g, the heading '{column.name} [g]' is needed.",
            stacklevel=2,
        )


def separated(what: str, lines: list[str]) -> tuple[str, list[list[str]]]:
    """The separator of the columns of a table, and the fields of each line.

    The separator that divides most lines into the same number of fields is chosen.

    Parameters
    ----------
    what : str
        Description of the table, for messages.
    lines : list[str]
        Lines of the table.

    Returns
    -------
    separator : str
        The separator; a blank for any white space, empty for a single column.
    rows : list[list[str]]
        Fields of each line.

    Raises
    ------
    InputError
        if a quoted field does not end.
    """
    # Numbers with decimal commas and no other separator are a single column.
    best: tuple[int, str, list[list[str]]] = (0, "", [[line.strip()] for line in lines])
    if len(lines) > 1 and "," not in lines[0] and all(re.fullmatch(r"\s*[+-]?\d+,\d+\s*", line) for line in lines[1:]):
        return best[1], best[2]

    # The separator with the most lines of equal length.
    for separator in SEPARATORS:
        try:
            rows = [[word.strip() for word in row] for row in csv.reader(lines, delimiter=separator)]
        except csv.Error as error:
            raise InputError(f"{what} is not a table: {error}; rows of equally many columns are needed.") from error
        counts = Counter(len(row) for row in rows if len(row) > 1)
        alike = max(counts.values(), default=0)
        if alike > best[0]:
            best = alike, separator, rows

    # Blanks separate columns if no other separator suits most lines; with headings of several words, two blanks are
    # needed.
    if best[0] <= len(lines) / 2:
        for blank in (r"\s+", r"\s{2,}"):
            blanks = [re.split(blank, line.strip()) for line in lines]
            if lines and len({len(row) for row in blanks}) == 1 and len(blanks[0]) > 1:
                return " ", blanks
        if len(lines) > 2 and best[0] <= 1:
            return "", [[line.strip()] for line in lines]
    return best[1], best[2]


def _unit_line(word: str) -> str | None:
    """Unit in a field of a line of units: empty for no unit, None if the field is not a unit."""
    bare = word.strip("()[]").strip()
    return "" if bare in ("", "-", "1") and not bare.isdigit() else _unit(bare)


def _unit(word: str) -> str | None:
    """The key of `UNITS` for a word; None if it is not a unit."""
    word = word.strip().replace("µ", "u").replace("μ", "u").replace("°", "deg")
    return word if word in UNITS else _CASELESS.get(word.lower())


def _named(heading: str) -> tuple[str, str]:
    """Split a heading into its name and its unit."""
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
    """Replace decimal commas of entries by points; raises `InputError` if commas may separate thousands."""
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
