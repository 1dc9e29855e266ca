"""Rows of tables as text, and the row class of the table of extreme mechanics (`taxel bench stability`)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

CONVERGED = "converged"


class TableRow(Protocol):
    """A row of a table: the result of one case. ``COLUMNS`` has the heading and the number format of each column, by
    the attribute that it shows."""

    COLUMNS: ClassVar[dict[str, tuple[str, str]]]


def headings(kind: type[TableRow]) -> list[str]:
    """Headings of the table of a row class."""
    return [heading for heading, _ in kind.COLUMNS.values()]


def cells(row: TableRow) -> list[str]:
    """Format a row as the cells of a table, in the order of its columns; "-" for a missing number."""
    return [_cell(row, name, form) for name, (_, form) in row.COLUMNS.items()]


def _cell(row: Any, name: str, form: str) -> str:
    """Format one attribute of a row, a number or a text. The verdict is followed by failures."""
    value = getattr(row, name)
    if name == "verdict" and row.wrong:
        return f"{value}; WRONG: {row.wrong}"
    if isinstance(value, str):
        return value or "-"
    return "-" if math.isnan(value) else format(value, form)


@dataclass(frozen=True)
class MechanicsRow:
    """Result of one case of extreme mechanics; missing values are NaN.

    Attributes
    ----------
    verdict : str
        ``converged``, ``ends at ...``, ``refused: ...``, or how the process ended.
    wrong : str
        Description of a failure; empty if there is none.
    iterations : float
        Number of Newton iterations, summed over all accepted load steps.
    steps : float
        Number of accepted load steps.
    cutbacks : float
        Number of load steps that were halved or abandoned.
    min_jacobian : float
        Smallest volume ratio J (Jacobian) at the quadrature points, over all accepted steps.
    node_jacobian : float
        Smallest J at the ten nodes of any element, in the last state.
    residual : float
        Largest residual (out-of-balance force) of any accepted step, relative to the load.
    imbalance : float
        Difference between the load and the reaction of the board in the last state, relative to the load.
    stability : str
        ``stable`` if all steps were tested for stability and are stable, else ``not checked``.
    roof : float
        Magnitude of the mean displacement of the roofs in the last state, in mm.
    stated_error : float
        Root mean square of the stated error of the roofs' displacement, relative to `roof`.
    finer_change : float
        Change of the mean displacement of the roofs on a finer mesh, relative to `roof`.
    seconds : float
        CPU time of the state and its error estimate, in s.
    megabytes : float
        Peak memory, in MB.
    inverted : str
        Load of the first accepted step with J <= 0 at a node of an element; empty if there is none.
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
