"""Rows of tables as text, and those of the table of extreme mechanics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

CONVERGED = "converged"


class TableRow(Protocol):
    """A row of a table; ``COLUMNS`` has heading and number format of each column, by name of the row's attribute."""

    COLUMNS: ClassVar[dict[str, tuple[str, str]]]


def headings(kind: type[TableRow]) -> list[str]:
    """Headings of the columns of a class of rows."""
    return [heading for heading, _ in kind.COLUMNS.values()]


def cells(row: TableRow) -> list[str]:
    """The row's cells as text, in the order of its columns; "-" where there is no number."""
    return [_cell(row, name, form) for name, (_, form) in row.COLUMNS.items()]


def _cell(row: Any, name: str, form: str) -> str:
    """A formatted number of a row, or a text; the verdict includes failures."""
    value = getattr(row, name)
    if name == "verdict" and row.wrong:
        return f"{value}; WRONG: {row.wrong}"
    if isinstance(value, str):
        return value or "-"
    return "-" if math.isnan(value) else format(value, form)


@dataclass(frozen=True)
class MechanicsRow:
    """Result of a case; missing values are NaN.

    Attributes
    ----------
    verdict : str
        ``converged``, ``ends at ...``, ``refused: ...``, or how the process ended.
    wrong : str
        Failure, empty if there is none.
    iterations : float
        Iterations of Newton's method, over all accepted steps.
    steps : float
        Accepted steps.
    cutbacks : float
        Number of steps halved or given up.
    min_jacobian : float
        Smallest volume ratio J at the quadrature points, at any accepted step.
    node_jacobian : float
        Smallest J at the ten nodes of the elements of the last state.
    residual : float
        Largest out-of-balance force of any accepted step, relative to the load.
    imbalance : float
        Difference of the load and the board's reaction at the last state, relative to the load.
    stability : str
        ``stable`` if every step was checked and is stable, else ``not checked``.
    roof : float
        Length of the mean displacement of the roofs at the last state, in mm.
    stated_error : float
        Root mean square of the stated error of the roofs, relative to `roof`.
    finer_change : float
        Change of the mean displacement on the finer mesh, relative to `roof`.
    seconds : float
        CPU time, for the state and its error.
    megabytes : float
        Peak memory.
    inverted : str
        Load of the first accepted step with J of 0 or less at a node of an element, empty if there is none.
    """

    COLUMNS: ClassVar = {
        "case": ("case", ""),
        "verdict": ("verdict", ""),
        "iterations": ("Newton", ".0f"),
        "steps": ("steps", ".0f"),
        "cutbacks": ("cutbacks", ".0f"),
        "min_jacobian": ("min J", ".3f"),
        "node_jacobian": ("min J at nodes", ".3f"),
        "residual": ("residual", ".0e"),
        "imbalance": ("imbalance", ".0e"),
        "stability": ("stability", ""),
        "roof": ("mean roof [mm]", ".4g"),
        "stated_error": ("stated error", ".2%"),
        "finer_change": ("finer mesh", ".2%"),
        "seconds": ("CPU s", ".1f"),
        "megabytes": ("MB", ".0f"),
    }
    case: str
    verdict: str
    wrong: str = ""
    iterations: float = math.nan
    steps: float = math.nan
    cutbacks: float = math.nan
    min_jacobian: float = math.nan
    node_jacobian: float = math.nan
    residual: float = math.nan
    imbalance: float = math.nan
    stability: str = ""
    roof: float = math.nan
    stated_error: float = math.nan
    finer_change: float = math.nan
    seconds: float = math.nan
    megabytes: float = math.nan
    inverted: str = ""
