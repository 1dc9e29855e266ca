"""Spreads and indices of tolerances in words, common to terminal and web page."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas

SPREAD_HEADINGS = ("figure", "taxel", "unit", "nominal", "mean", "spread", "linear", "not linear", "explained")
SPREADS = "Spreads are one standard deviation, relative to the nominal value"
INDICES = "Which tolerance costs most: total Sobol' indices, mean of the taxels"


def spread_rows(spread: pandas.DataFrame) -> list[tuple[str, ...]]:
    """Format the table of spreads, ``spread.csv``, as rows of text.

    Parameters
    ----------
    spread : pandas.DataFrame
        Columns as in ``spread.csv``.

    Returns
    -------
    list[tuple[str, ...]]
        Cells of each row.
    """
    return [
        (
            str(row.figure),
            str(row.taxel),
            str(row.unit),
            f"{row.nominal:.4g}{_error_of(row)}",
            _with_error(
                _relative(row.mean - row.nominal, row.nominal),
                _relative(getattr(row, "mean_error", math.nan), abs(row.nominal)),
            ),
            _with_error(_relative(row.sd, abs(row.nominal)), _relative(row.sd_error, abs(row.nominal))),
            _percent(_relative(row.linear_sd, abs(row.nominal))),
            _percent(row.linear_error),
            _percent(max(row.explained, 0.0)),  # cross-validated: below 0 if it explains nothing
        )
        for row in spread.itertuples()
    ]


def spread_answer(spread: pandas.DataFrame) -> str:
    """State the largest relative spread of each figure over the taxels, with its error, in one line.

    Parameters
    ----------
    spread : pandas.DataFrame
        Columns as in ``spread.csv``.

    Returns
    -------
    str
        Such as ``Spread (one standard deviation): rest 10.5% ± 2.4%, sensitivity 9.5% ± 2.2%.``
    """
    relative = (spread.sd / spread.nominal.abs()).where(spread.nominal != 0)
    worst = spread.loc[relative.dropna().groupby(spread.figure, sort=False).idxmax()]
    words = [
        f"{row.figure} {_with_error(_relative(row.sd, abs(row.nominal)), _relative(row.sd_error, abs(row.nominal)))}"
        for row in worst.itertuples()
    ]
    of = " of the worst taxel" if spread.taxel.nunique() > 1 else ""
    return f"Spread{of} (one standard deviation): {', '.join(words)}."


def _error_of(row: Any) -> str:
    error = getattr(row, "nominal_error", math.nan)  # older studies have none
    return f" ± {error:.1g}" if math.isfinite(error) and error else ""


def index_rows(parameters: pandas.DataFrame) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Format the table of total Sobol' indices, ``parameters.csv``, as headings and rows of text.

    Parameters
    ----------
    parameters : pandas.DataFrame
        Columns as in ``parameters.csv``.

    Returns
    -------
    headings : tuple[str, ...]
        Headings of the columns.
    rows : list[tuple[str, ...]]
        Their cells.
    """
    figures = [name for name in parameters if name.startswith("total_") and "total_error_" not in name]
    headings = ("parameter", "law", *(name.removeprefix("total_") for name in figures))
    rows = parameters.to_dict("records")
    return headings, [(row["parameter"], row["law"], *(_index(row, name) for name in figures)) for row in rows]


def _percent(value: float) -> str:
    return "-" if math.isnan(value) else f"{round(value, 3) + 0.0:.1%}"  # what rounds to zero has no sign


def _with_error(value: float, error: float) -> str:
    return _percent(value) if math.isnan(error) else f"{_percent(value)} ± {_percent(error)}"


def _index(row: dict[str, Any], name: str) -> str:
    error = row[name.replace("total_", "total_error_", 1)]
    return "not known" if math.isnan(row[name]) else _with_error(row[name], error)


def _relative(value: float, nominal: float) -> float:
    return value / nominal if nominal else math.nan
