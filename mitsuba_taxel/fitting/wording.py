"""Unknowns of a fit in words, for both terminal and web page."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from mitsuba_taxel.characterise.wording import with_error

if TYPE_CHECKING:
    import pandas

UNKNOWN_HEADINGS = ("unknown", "start", "value", "data ±", "model ±", "95 % interval")


def unknown_rows(unknowns: pandas.DataFrame) -> list[tuple[str, ...]]:
    """Format the table of unknowns, ``fit.csv``, as rows of text.

    Parameters
    ----------
    unknowns : pandas.DataFrame
        Columns as in ``fit.csv``.

    Returns
    -------
    list[tuple[str, ...]]
        Cells of each row.
    """
    return [_cells(row) for row in unknowns.itertuples()]


def fit_answer(unknowns: pandas.DataFrame) -> str:
    """State the unknowns with their errors in one line.

    Parameters
    ----------
    unknowns : pandas.DataFrame
        Columns as in ``fit.csv``.

    Returns
    -------
    str
        One line, such as ``youngs_modulus = 4.36 ± 0.12, gain = 180.19 ± 0.37.``
    """
    return ", ".join(f"{row.unknown} = {_value(row)}" for row in unknowns.itertuples()) + "."


def _value(row: Any) -> str:
    return with_error(row.value, row.error) if math.isfinite(row.error) else f"{row.value:.4g} (not determined)"


def _cells(row: Any) -> tuple[str, ...]:
    value = with_error(row.value, row.error) if math.isfinite(row.error) else f"{row.value:.4g}, not determined"
    ends = f"{row.low:.6g} to {row.high:.6g}" if math.isfinite(row.error) else "-"
    return str(row.unknown), f"{row.start:.4g}", value, f"{row.data_error:.2g}", f"{row.model_error:.2g}", ends
