"""Figures of merit as text: a value with its error, rows of a table, a LaTeX table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.characterise.characteristics import DEVIATIONS, NO_CHANGE, NOT_ABOVE, NOT_RESOLVED, SLOPES

if TYPE_CHECKING:
    import pandas
    import xarray as xr

LATEX = {"µ": r"$\mu$", "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"} | {
    letter: f"\\{letter}" for letter in "&%$#_{}"
}

AS_SHOWN = "Output of the circuit"
"""Title of the table of circuit figures."""
CIRCUIT_UNITS = {"_V_per_N": "V/N", "_counts_per_N": "counts/N", "_counts": "counts", "_V": "V", "_N": "N"}
"""Units by the end of a column's name in the table of circuit figures."""
REMARKS = {
    NOT_RESOLVED: "smaller than its standard error; the tables on disk contain the number",
    NO_CHANGE: "the reading is the same at all forces, as that of a saturated output",
    NOT_ABOVE: "no slope is significantly larger than the mean slope",
}


def with_error(value: float, error: float, latex: bool = False) -> str:
    """A value with its error as text, such as ``(1.480 ± 0.031)e-04``.

    The error has two digits and the value as many decimals; without an error, the value has four digits.

    Parameters
    ----------
    value, error : float
        Value and error in the same unit; an error of NaN is omitted.
    latex : bool
        Whether the result is a formula of LaTeX.

    Returns
    -------
    str
        The text; ``-`` for a missing value.
    """
    if not math.isfinite(value):
        return "--" if latex else "-"
    size = max(abs(value), error if math.isfinite(error) else 0.0)
    power = math.floor(math.log10(size)) if size > 0 else 0
    power = 0 if -2 <= power <= 3 else power
    value, error = value / 10.0**power, error / 10.0**power
    plus_minus, scale = (r" \pm ", rf" \times 10^{{{power}}}") if latex else (" ± ", f"e{power:+03d}")
    has_error = error > 0
    leading = math.floor(math.log10(error if has_error else abs(value) or 1.0))
    digits = max((1 if has_error else 3) - leading, 0)
    text = f"{round(value, digits) + 0.0:.{digits}f}"  # adding 0.0 removes the minus sign of a zero
    if not math.isnan(error):
        text = f"{text}{plus_minus}{error:.{digits if has_error else 0}f}"
        text = f"({text})" if power else text
    text += scale if power else ""
    return f"${text}$" if latex else text


def table_rows(
    table: pandas.DataFrame, figures: Sequence[str], latex: bool = False
) -> tuple[list[str], list[list[str]]]:
    """Format selected figures of merit as a table of text, one row per taxel and run.

    Units have the prefix that suits the numbers of a figure. A remark replaces the number. Columns that are constant
    are left out, except the force and the taxel.

    Parameters
    ----------
    table : pandas.DataFrame
        Result of :func:`characteristics`.
    figures : sequence of str
        Names of figures; names that are not in the table are ignored.
    latex : bool
        Whether numbers are formulas of LaTeX.

    Returns
    -------
    headings : list[str]
        Headings of the columns.
    rows : list[list[str]]
        Cells of each row.
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
    figure_headings = [
        cell
        for name in figures
        for cell in [f"{name.replace('_', ' ')} [{scales[name][1]}]", *["at [N]"] * _has_place(name)]
    ]
    missing = {name: ["-"] * (1 + _has_place(name)) for name in figures}
    key_columns = [keys.index(name) for name in headings]
    return headings + figure_headings, [
        [
            *(key[number] for number in key_columns),
            *(cell for name in figures for cell in cells_by_figure.get(name, missing[name])),
        ]
        for key, cells_by_figure in rows.items()
    ]


def by_reading(table: pandas.DataFrame) -> dict[str, pandas.DataFrame]:
    """Split a table of characteristics by the unit of the readings, W or V.

    Parameters
    ----------
    table : pandas.DataFrame
        Result of :func:`characteristics`.

    Returns
    -------
    dict[str, pandas.DataFrame]
        Tables by unit; if all readings have the same unit, the whole table under the key ``""``.
    """
    if "reading" not in table:
        return {"": table}
    return {unit: table[table.reading == unit] for unit in table.reading.unique()}


def merit_tables(
    table: pandas.DataFrame, volts: pandas.DataFrame | None = None
) -> dict[str, tuple[list[str], list[list[str]]]]:
    """Format figures of merit as tables of text: slopes and deviations for each unit, and figures of the circuit.

    Parameters
    ----------
    table : pandas.DataFrame
        Result of :func:`characteristics`.
    volts : pandas.DataFrame, optional
        Result of :func:`volts_table`.

    Returns
    -------
    dict[str, tuple[list[str], list[list[str]]]]
        Headings and rows by title.
    """
    titled = {}
    for unit, rows in by_reading(table).items():
        suffix = f" of readings in {unit}" if unit else ""
        titled[f"Sensitivities{suffix}"] = table_rows(rows, SLOPES)
        titled[f"Largest deviations{suffix}, in percent of the largest change"] = table_rows(rows, DEVIATIONS)
    return titled if volts is None else {**titled, AS_SHOWN: figure_rows(volts)}


def slope_answers(table: pandas.DataFrame, parameters: Mapping[str, str] | None = None) -> list[str]:
    """State the mean slope along each force with its error, in one line for each force and unit of the readings.

    Parameters
    ----------
    table : pandas.DataFrame
        Result of :func:`characteristics`.
    parameters : Mapping[str, str], optional
        Result of :func:`forces_by_parameter`: a force is then shown with the scene's own parameter, as ``fz = -push``.

    Returns
    -------
    list[str]
        Such as ``Mean slope over fz: -223.9 ± 5.1 µW/N.``; empty if there is no slope.
    """
    answers, parameters = [], parameters or {}
    for rows in by_reading(table).values() if len(table) else ():
        slopes = rows[(rows.figure == "mean_slope") & rows.value.notna()]
        for component in slopes.force.unique():
            along = slopes[slopes.force == component]
            force = f"{component} = {parameters[component]}" if component in parameters else component
            factor, unit = _scale(along)
            if not (along.value.any() or along.error.any()):
                answers.append(f"No slope in {unit} over {force}: readings do not change.")
            elif len(along) == 1:
                slope = f"{with_error(along.value.iloc[0] / factor, along.error.iloc[0] / factor)} {unit}"
                answers.append(f"Mean slope over {force}: {slope}.")
            else:
                low, high = (f"{end / factor:.4g}" for end in (along.value.min(), along.value.max()))
                largest = along.error.max() / factor
                error = f", each ± {largest:.2g} {unit} or less" if math.isfinite(largest) else ""
                answers.append(f"Mean slopes over {force}: {low} to {high} {unit}{error}.")
    return answers


def power_answer(study: xr.Dataset) -> str:
    """State the range of the readings of a study, with their largest total error, in one line.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene, with ``power`` and ``total_error`` in W.

    Returns
    -------
    str
        Such as ``Power over z: 2.41 to 19.71 mW, each ± 0.31 mW or less.``; empty if there is no reading.
    """
    power, error = study.power.values, study.total_error.values
    read = np.isfinite(power)
    if not read.any():
        return ""
    low, high, largest = power[read].min(), power[read].max(), error[read].max()
    factor, unit = prefixed(high, "W")
    over = ", ".join(str(dim) for dim in study.power.dims if dim != "taxel")
    is_known, error_words = math.isfinite(largest), f"± {largest / factor:.2g} {unit}"
    if read.sum() == 1:
        stated = f" {error_words}" if is_known else "; the error is unknown"
        return f"Power over {over}: {high / factor:.4g} {unit}{stated}."
    stated = f", each {error_words} or less" if is_known else "; an error is unknown"
    return f"Power over {over}: {low / factor:.4g} to {high / factor:.4g} {unit}{stated}."


def pair_rows(pairs: pandas.DataFrame, latex: bool = False) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of a table of symmetric pairs, one row per pair.

    Parameters
    ----------
    pairs : pandas.DataFrame
        Result of :func:`symmetric_pairs`.
    latex : bool
        Whether numbers are formulas of LaTeX.

    Returns
    -------
    headings : list[str]
        Headings of the columns; empty without a pair.
    rows : list[list[str]]
        Cells of each row.
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
    """Headings and rows of a table of circuit figures, with units; ``-`` for a missing number.

    Numbers have four digits, or their error. Volts and newtons have the prefix that suits the numbers of a column.

    Parameters
    ----------
    table : pandas.DataFrame
        Result of :func:`volts_table`.

    Returns
    -------
    headings : list[str]
        Headings of the columns.
    rows : list[list[str]]
        Cells of each row.
    """
    columns: dict[str, list[str]] = {}
    for name in (name for name in table.columns if not name.endswith("_error")):
        suffix = next((suffix for suffix in CIRCUIT_UNITS if name.endswith(suffix)), None)
        if suffix is None:
            columns[name] = [as_word(value) for value in table[name].tolist()]
            continue
        values, unit = table[name].to_numpy(float), CIRCUIT_UNITS[suffix]
        errors = table.get(f"{name}_error", table[name] * math.nan).to_numpy(float)
        finite = values[abs(values) < math.inf]
        factor, unit = (1.0, unit) if unit.startswith("counts") else prefixed(abs(finite).max(initial=0.0), unit)
        columns[f"{name.removesuffix(suffix).replace('_', ' ')} [{unit}]"] = [
            as_word(float(f"{value / factor:.4g}")) if math.isnan(error) else with_error(value / factor, error / factor)
            for value, error in zip(values, errors, strict=True)
        ]
    return list(columns), [list(cells) for cells in zip(*columns.values(), strict=True)]


def _scale(table: pandas.DataFrame, column: str = "value") -> tuple[float, str]:
    """Factor and prefixed unit of the numbers in a column, which all have the same unit."""
    return prefixed(float(table[column].abs().max()), table.unit.iloc[0])


def _number(record: dict[Any, Any], column: str, factor: float, latex: bool) -> str:
    return record["remark"] or with_error(record[column] / factor, record["error"] / factor, latex)


def remarks_explained(*tables: pandas.DataFrame) -> list[str]:
    """Explanations of the remarks that replace numbers in tables, one line per remark.

    Parameters
    ----------
    *tables : pandas.DataFrame
        Tables with a column ``remark``.

    Returns
    -------
    list[str]
        Explanations; empty if there is no remark.
    """
    remarks = {remark for table in tables for remark in table.remark}
    return [f"{remark}: {meaning}." for remark, meaning in REMARKS.items() if remark in remarks]


def latex_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A plain LaTeX ``tabular``, which needs no package. Cells that start and end with ``$`` are not escaped.

    Parameters
    ----------
    headings : sequence of str
        Headings of the columns.
    rows : sequence of sequence of str
        Cells of each row.

    Returns
    -------
    str
        LaTeX source.
    """

    def line(cells: Sequence[str]) -> str:
        return " & ".join(cell if _is_formula(cell) else escape(cell) for cell in cells) + r" \\"

    columns = "".join("r" if any(map(_is_number, column)) else "l" for column in zip(*rows, strict=True))
    body = [line(headings), r"\hline", *map(line, rows)]
    return "\n".join([rf"\begin{{tabular}}{{{columns}}}", r"\hline", *body, r"\hline", r"\end{tabular}", ""])


def escape(text: str) -> str:
    """Escape the special characters of LaTeX in a text."""
    return "".join(LATEX.get(letter, letter) for letter in text)


def as_word(value: Any) -> str:
    """Format the value of a parameter, a number or text, as text for tables.

    Parameters
    ----------
    value : Any
        A float is printed with six digits.

    Returns
    -------
    str
        The text; ``-`` for a number that is not finite.
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
