"""Result class of `taxel bench figures`: figures of merit of one scene, and their reference values."""

from __future__ import annotations

import math
from dataclasses import field, make_dataclass
from typing import Any

FIGURES = ("mean_slope", "max_slope", "zero_slope", "relative_slope", "nonlinearity", "hysteresis")
TARGETS = {"default": None, "permille_2": 0.002, "permille_1": 0.001}
"""Target errors of the sweeps, by the names in columns."""
KINDS = ("value", "error")

_TRUE = ("true", "noise", "further")
"""Columns of the reference value of each figure of merit: the value in the limit of small elements, its noise, and its
change by the extrapolation."""


TRUTH_SHARE = 0.5
"""Error of a reference value, as a fraction of its change by the extrapolation. The extrapolation assumes that errors
fall with the power 1.5 of the element size; powers of 1 and 2 would change it by 50 and -25 % if the two sizes differ
little."""
LEAST_TRUTH = 0.002
"""Smallest relative error of the reference value of a slope, because two meshes may agree by chance. Elements of 0.6 mm
have errors of 0.4 % if elements of 1.1 mm have the typical error of 1 %; the extrapolation halves this error."""


def _truth_error(row: Any, figure: str) -> float:
    """Standard error of the reference value of a figure of merit, due to the extrapolation and the noise."""
    true, noise, extrapolation = (getattr(row, f"{figure}_{kind}") for kind in _TRUE)
    least = LEAST_TRUTH * abs(true) if figure.endswith("slope") else 0.0
    return math.hypot(max(TRUTH_SHARE * abs(extrapolation), least), noise)


def _deviation(row: Any, figure: str, target: str) -> float:
    """True error of a figure of merit divided by the combined standard error of sweep and reference value; NaN if
    unknown."""
    value, error = (getattr(row, f"{figure}_{target}_{kind}") for kind in KINDS)
    combined_error = math.hypot(error, row.truth_error(figure))
    return (value - getattr(row, f"{figure}_true")) / combined_error if combined_error else math.nan


def _weakness(row: Any, figure: str, target: str) -> float:
    """Standard error of the reference value divided by the stated error of the sweep; above 1, the comparison says
    little about the stated error."""
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
        ("course", "float", field(default=math.nan)),
        ("strain", "float", field(default=math.nan)),
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
