"""One row of the table of figures of merit against those on finer elements."""

from __future__ import annotations

import math
from dataclasses import field, make_dataclass
from typing import Any

FIGURES = ("mean_slope", "max_slope", "zero_slope", "relative_slope", "nonlinearity", "hysteresis")
TARGETS = {"default": None, "permille_2": 0.002, "permille_1": 0.001}
"""Target errors of the sweeps by the name that columns have."""
KINDS = ("value", "error")

_TRUE = ("true", "noise", "further")
"""Of each figure: its value in the limit of small elements, the noise of that, and its change by the extrapolation."""


def _deviation(row: Any, figure: str, target: str) -> float:
    """Error of a figure of a sweep over the stated one, combined with the noise of the truth; NaN if it is unknown."""
    value, error = (getattr(row, f"{figure}_{target}_{kind}") for kind in KINDS)
    stated = math.hypot(error, getattr(row, f"{figure}_noise"))
    return (value - getattr(row, f"{figure}_true")) / stated if stated else math.nan


FigureRow = make_dataclass(
    "FigureRow",
    [
        ("case", "str"),
        ("remark", "str", field(default="")),
        ("seconds", "float", field(default=math.nan)),
        ("true_seconds", "float", field(default=math.nan)),
        ("fine", "float", field(default=math.nan)),
        *((f"{figure}_{kind}", "float", field(default=math.nan)) for figure in FIGURES for kind in _TRUE),
        *(
            (f"{figure}_{target}_{kind}", "float", field(default=math.nan))
            for figure in FIGURES
            for target in TARGETS
            for kind in KINDS
        ),
    ],
    frozen=True,
    namespace={"deviation": _deviation},
)
