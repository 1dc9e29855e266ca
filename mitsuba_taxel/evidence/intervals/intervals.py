"""Stated errors of figures that need no pad, counted on made-up truth: recordings, tolerances, exact models."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.evidence.intervals.calibrations import calibration_cases
from mitsuba_taxel.evidence.intervals.comparisons import comparison_cases
from mitsuba_taxel.evidence.intervals.fits import fit_cases
from mitsuba_taxel.evidence.intervals.models import model_cases
from mitsuba_taxel.evidence.intervals.records import record_cases
from mitsuba_taxel.evidence.intervals.tolerances import tolerance_cases

TWICE = 0.9545
"""Share of normal errors within twice their standard deviation."""
ALLOWED = 0.03
"""Largest allowed lack of that share."""
FIRST_SEED = 10_000
"""Smaller seeds served to choose constants of the estimates."""
FAMILIES: tuple[tuple[Callable[[], Mapping[str, Callable[[int], Any]]], int], ...] = (
    (record_cases, 200),
    (tolerance_cases, 200),
    (fit_cases, 1000),
    (calibration_cases, 30),
    (model_cases, 100),
    (comparison_cases, 80),
)
"""Kinds of made-up truth by name, and the number of seeds of each."""


@dataclass(frozen=True)
class IntervalRow:
    """How often the stated error of a figure holds.

    Attributes
    ----------
    case : str
        What was made up.
    figure : str
        Figure whose error is counted.
    made : float
        Number of figures of made-up truths with a stated error.
    unstated : float
        Number of those without any.
    within : float
        Share of errors within twice the stated one.
    ratio : float
        Root mean square of the errors, each over the stated one.
    seconds : float
        Of processors' time, for all figures of the case.
    """

    COLUMNS: ClassVar = {
        "case": ("made up", ""),
        "figure": ("figure", ""),
        "made": ("stated errors", ".0f"),
        "unstated": ("none stated", ".0f"),
        "within": ("coverage", ".1%"),
        "ratio": ("true / stated, rms", ".2f"),
        "seconds": ("CPU s", ".0f"),
    }
    case: str
    figure: str
    made: float
    unstated: float
    within: float
    ratio: float
    seconds: float = math.nan


@dataclass(frozen=True)
class IntervalCase:
    """A kind of made-up truth.

    Attributes
    ----------
    name : str
    deviations : Callable[[int], dict[str, float or ndarray]]
        Of a seed: the error of each figure over the stated one, or several of them; NaN where none is stated.
    count : int
        Number of seeds.
    """

    name: str
    deviations: Callable[[int], Mapping[str, Any]]
    count: int = 200

    def measured(self) -> list[IntervalRow]:
        """One row per figure."""
        began = time.process_time()
        found: dict[str, list[float]] = {}
        for seed in range(FIRST_SEED, FIRST_SEED + self.count):
            for figure, deviation in self.deviations(seed).items():
                found.setdefault(figure, []).extend(np.atleast_1d(deviation).tolist())
        seconds = time.process_time() - began
        rows = []
        for figure, values in found.items():
            stated = np.array([value for value in values if not math.isnan(value)])
            within, ratio = float(np.mean(np.abs(stated) <= 2)), float(np.sqrt(np.mean(stated**2)))
            rows.append(IntervalRow(self.name, figure, len(stated), len(values) - len(stated), within, ratio, seconds))
        return rows


def interval_cases(only: str | None = None) -> list[IntervalCase]:
    """The kinds whose name contains a pattern with the wildcards * and ?, in the order of the table."""
    every = [IntervalCase(*case, count) for cases, count in FAMILIES for case in cases().items()]
    return [case for case in every if only is None or fnmatchcase(case.name, f"*{only}*")]


def intervals(only: str | None = None, starting: Callable[[str], None] | None = None) -> Iterator[IntervalRow]:
    """Rows of the table as they are measured, of cases whose name contains a pattern."""
    for case in interval_cases(only):
        if starting:
            starting(case.name)
        yield from case.measured()


def summary(rows: Sequence[IntervalRow]) -> str:
    """A sentence with the number of figures whose errors hold."""
    good = sum(row.within >= TWICE - ALLOWED for row in rows)
    within = np.average([row.within for row in rows], weights=[row.made for row in rows]) if rows else math.nan
    return (
        f"Of {len(rows)} figures, the stated errors of {good} hold 95 % within twice, or at most 3 points less; of all "
        f"errors {within:.1%} do."
    )
