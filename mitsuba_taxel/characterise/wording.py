"""Figures of merit as text: a value with its error, rows of a table, a LaTeX table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.characterise.characteristics import DEVIATIONS, NOT_ABOVE, NOT_RESOLVED, SLOPES

if TYPE_CHECKING:
    import pandas

LATEX = {"µ": r"$\mu$", "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"} | {
    letter: f"\\{letter}" for letter in "&%$#_{}"
}

AS_SHOWN = "As the circuit shows it"
"""Title of a table of circuit figures."""
REMARKS = {
    NOT_RESOLVED: "smaller than its standard error; the tables on disk hold the number",
    NOT_ABOVE: "no slope is resolved to be larger than the mean one",
}


def with_error(value: float, error: float, latex: bool = False) -> str:
    """``(1.480 ± 0.031)e-04``: the error with two digits, the value to the same place; ``-`` for a missing value.

    Without an error, the value has four digits.

    Parameters
    ----------
    value, error : float
        In the same unit; an error of NaN is left out.
    latex : bool
        Whether the result is a formula of LaTeX.

    Returns
    -------
    str
        One word.
    """
    if not math.isfinite(value):
        return "--" if latex else "-"
    size = max(abs(value), error if math.isfinite(error) else 0.0)
    power = math.floor(math.log10(size)) if size > 0 else 0
    power = 0 if -2 <= power <= 3 else power
    value, error = value / 10.0**power, error / 10.0**power
    plus_minus, scale = (r" \pm ", rf" \times 10^{{{power}}}") if latex else (" ± ", f"e{power:+03d}")
    known = error > 0
    leading = math.floor(math.log10(error if known else abs(value) or 1.0))
    digits = max((1 if known else 3) - leading, 0)
    text = f"{round(value, digits) + 0.0:.{digits}f}"  # no minus before a zero
    if not math.isnan(error):
        text = f"{text}{plus_minus}{error:.{digits if known else 0}f}"
        text = f"({text})" if power else text
    text += scale if power else ""
    return f"${text}$" if latex else text


def table_rows(
    table: pandas.DataFrame, figures: Sequence[str], latex: bool = False
) -> tuple[list[str], list[list[str]]]:
    """Headings and rows, one per taxel and run, of those ``figures`` that are in a table of characteristics.

    Units have the prefix that fits a figure's numbers; a remark replaces the number. Constant columns other than the
    force and the taxel are left out.

    Parameters
    ----------
    table : pandas.DataFrame
        Of :func:`characteristics`.
    figures : sequence of str
        Names of figures.
    latex : bool
        Whether numbers are formulas of LaTeX.

    Returns
    -------
    headings : list[str]
        Of the columns.
    rows : list[list[str]]
        Their cells.
    """
    table = table[table.figure.isin(figures)]
    figures = [name for name in figures if name in set(table.figure)]
    numbers = ("figure", "value", "error", "unit", "at_N", "from_N", "to_N", "remark")
    keys = [name for name in table.columns if name not in numbers]
    headings = [name for name in keys if name in ("force", "taxel") or table[name].nunique(dropna=False) > 1]
    scales = {name: _scale(table[table.figure == name]) for name in figures}
    rows: dict[tuple, dict[str, list[str]]] = {}
    for record in table.to_dict("records"):
        key = tuple(as_word(record[name]) for name in keys)
        cells = [_number(record, "value", scales[record["figure"]][0], latex)]
        if _has_place(record["figure"]):
            cells.append("" if record["remark"] else as_word(round(record["at_N"], 3) + 0.0))
        rows.setdefault(key, {})[record["figure"]] = cells
    wide = [
        cell
        for name in figures
        for cell in [f"{name.replace('_', ' ')} [{scales[name][1]}]", *["at [N]"] * _has_place(name)]
    ]
    blank = {name: ["-"] * (1 + _has_place(name)) for name in figures}
    kept = [keys.index(name) for name in headings]
    return headings + wide, [
        [*(key[number] for number in kept), *(cell for name in figures for cell in found.get(name, blank[name]))]
        for key, found in rows.items()
    ]


def by_reading(table: pandas.DataFrame) -> dict[str, pandas.DataFrame]:
    """A table of characteristics split by the unit of the readings if it has several; else the whole table, by
    ``""``.

    Parameters
    ----------
    table : pandas.DataFrame
        Of :func:`characteristics`.

    Returns
    -------
    dict[str, pandas.DataFrame]
        By unit.
    """
    if "reading" not in table:
        return {"": table}
    return {unit: table[table.reading == unit] for unit in table.reading.unique()}


def merit_tables(
    table: pandas.DataFrame, volts: pandas.DataFrame | None = None
) -> dict[str, tuple[list[str], list[list[str]]]]:
    """Headings and rows of slopes and deviations, for each unit of the readings, and of a table of circuit figures, by
    title.

    Parameters
    ----------
    table : pandas.DataFrame
        Of :func:`characteristics`.
    volts : pandas.DataFrame, optional
        Of :func:`volts_table`.

    Returns
    -------
    dict[str, tuple[list[str], list[list[str]]]]
        Headings and rows by title.
    """
    titled = {}
    for unit, part in by_reading(table).items():
        of = f" of readings in {unit}" if unit else ""
        titled[f"Sensitivities{of}"] = table_rows(part, SLOPES)
        titled[f"Largest deviations{of}, in percent of the largest change"] = table_rows(part, DEVIATIONS)
    return titled if volts is None else {**titled, AS_SHOWN: figure_rows(volts)}


def pair_rows(pairs: pandas.DataFrame, latex: bool = False) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of a table of symmetric pairs, one per pair.

    Parameters
    ----------
    pairs : pandas.DataFrame
        Of :func:`symmetric_pairs`.
    latex : bool
        Whether numbers are formulas of LaTeX.

    Returns
    -------
    headings : list[str]
        Of the columns; none without a pair.
    rows : list[list[str]]
        Their cells.
    """
    if not len(pairs):
        return [], []
    keys = [name for name in pairs.columns if name not in ("difference", "error", "unit", "remark")]
    factor, unit = _scale(pairs, "difference")
    return [*keys, f"difference [{unit}]"], [
        [*(as_word(record[name]) for name in keys), _number(record, "difference", factor, latex)]
        for record in pairs.to_dict("records")
    ]


def figure_rows(table: pandas.DataFrame) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of a table of circuit figures, with four digits; ``-`` for a missing one.

    Parameters
    ----------
    table : pandas.DataFrame
        Of :func:`volts_table`.

    Returns
    -------
    headings : list[str]
        Of the columns.
    rows : list[list[str]]
        Their cells.
    """
    cells = table.map(lambda value: as_word(float(f"{value:.4g}")) if isinstance(value, float) else str(value))
    return list(table.columns), cells.values.tolist()


def _scale(table: pandas.DataFrame, column: str = "value") -> tuple[float, str]:
    """Factor and unit of the numbers in a column, all of one unit."""
    return prefixed(float(table[column].abs().max()), table.unit.iloc[0])


def _number(record: dict[Any, Any], column: str, factor: float, latex: bool) -> str:
    return record["remark"] or with_error(record[column] / factor, record["error"] / factor, latex)


def remarks_explained(*tables: pandas.DataFrame) -> list[str]:
    """A line for each remark that replaces numbers in some tables.

    Parameters
    ----------
    *tables : pandas.DataFrame
        With a column ``remark``.

    Returns
    -------
    list[str]
        Empty if there is no remark.
    """
    said = {remark for table in tables for remark in table.remark}
    return [f"{remark}: {meaning}." for remark, meaning in REMARKS.items() if remark in said]


def latex_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A plain ``tabular``, which needs no package. Cells that start and end with ``$`` are not escaped.

    Parameters
    ----------
    headings : sequence of str
        Of the columns.
    rows : sequence of sequence of str
        Their cells.

    Returns
    -------
    str
        Text of LaTeX.
    """

    def line(cells: Sequence[str]) -> str:
        return " & ".join(cell if _is_formula(cell) else escape(cell) for cell in cells) + r" \\"

    columns = "".join("r" if any(map(_is_number, column)) else "l" for column in zip(*rows, strict=True))
    body = [line(headings), r"\hline", *map(line, rows)]
    return "\n".join([rf"\begin{{tabular}}{{{columns}}}", r"\hline", *body, r"\hline", r"\end{tabular}", ""])


def escape(text: str) -> str:
    """Text with the special characters of LaTeX escaped."""
    return "".join(LATEX.get(letter, letter) for letter in text)


def as_word(value: Any) -> str:
    """A parameter or a number as text; ``-`` if missing.

    Parameters
    ----------
    value : Any
        A number is given six digits.

    Returns
    -------
    str
        One word.
    """
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else "-"
    return str(value)


def _has_place(figure: str) -> bool:
    return figure not in ("mean_slope", "zero_slope", "relative_slope")


def _is_formula(cell: str) -> bool:
    return len(cell) > 1 and cell[0] == cell[-1] == "$"


def _is_number(cell: str) -> bool:
    return _is_formula(cell) or cell.lstrip("-").replace(".", "").isdigit()
