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


TRUTH_SHARE = 0.5
"""Error of what is extrapolated to elements of no size, relative to the extrapolation, which assumes that errors fall
with the power 1.5 of their size: powers of 1 and 2 change it by 50 and -25 %, where sizes differ little."""
LEAST_TRUTH = 0.002
"""Least error of a slope in the limit, relative to it: two meshes may agree by chance. Elements of 0.6 mm have errors
of 0.4 %, if default ones of 1.1 mm have the 1 % that is typical of them, and half of that is left."""


def _truth_error(row: Any, figure: str) -> float:
    """Standard error of a figure in the limit of small elements: by the extrapolation and the noise of random paths."""
    true, noise, further = (getattr(row, f"{figure}_{kind}") for kind in _TRUE)
    least = LEAST_TRUTH * abs(true) if figure.endswith("slope") else 0.0
    return math.hypot(max(TRUTH_SHARE * abs(further), least), noise)


def _deviation(row: Any, figure: str, target: str) -> float:
    """Error of a figure of a sweep over the stated one, combined with that of the truth; NaN if it is unknown."""
    value, error = (getattr(row, f"{figure}_{target}_{kind}") for kind in KINDS)
    stated = math.hypot(error, row.truth_error(figure))
    return (value - getattr(row, f"{figure}_true")) / stated if stated else math.nan


def _weakness(row: Any, figure: str, target: str) -> float:
    """Error of the truth over the stated one: above 1, the comparison says little of what is stated."""
    error = getattr(row, f"{figure}_{target}_error")
    return row.truth_error(figure) / error if error else math.nan


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
    namespace={"deviation": _deviation, "truth_error": _truth_error, "weakness": _weakness},
)
