"""Table of the coverage of stated errors on synthetic data: recordings, tolerance studies, fits, exported models,
comparisons."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.evidence.intervals.calibrations import calibration_cases
from mitsuba_taxel.evidence.intervals.comparisons import comparison_cases
from mitsuba_taxel.evidence.intervals.fits import fit_cases
from mitsuba_taxel.evidence.intervals.models import model_cases
from mitsuba_taxel.evidence.intervals.records import record_cases
from mitsuba_taxel.evidence.intervals.tolerances import tolerance_cases
from mitsuba_taxel.evidence.rows.row_files import matching

TWICE = 0.9545
"""Fraction of normal errors within twice their standard deviation."""
ALLOWED = 0.03
"""Allowed deficit of that fraction."""
FIRST_SEED = 10_000
"""First seed of the table; smaller ones were used to choose constants of the estimates."""
FAMILIES: tuple[tuple[Callable[[], Mapping[str, Callable[[int], Any]]], int], ...] = (
    (record_cases, 200),
    (tolerance_cases, 200),
    (fit_cases, 1000),
    (calibration_cases, 30),
    (model_cases, 100),
    (comparison_cases, 80),
)
"""Functions that return cases by name, and the number of seeds of each case."""


@dataclass(frozen=True)
class IntervalRow:
    """Coverage of the stated error of one quantity ("figure").

    Attributes
    ----------
    case : str
        Name of the synthetic data.
    figure : str
        Name of the quantity.
    made : float
        Number of values with a stated error.
    unstated : float
        Number of values without a stated error.
    within : float
        Fraction of the true errors within twice the stated error.
    ratio : float
        Root mean square of the ratio of true to stated error.
    seconds : float
        CPU time of all quantities of the case, in s.
    """

    COLUMNS: ClassVar = {
        "case": ("synthetic data", ""),
        "figure": ("result", ""),
        "made": ("stated errors", ".0f"),
        "unstated": ("not stated", ".0f"),
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
    """One kind of synthetic data, drawn for many seeds.

    Attributes
    ----------
    name : str
        Name in the table.
    deviations : Callable[[int], dict[str, float or ndarray]]
        Returns, for a seed and by name of the quantity, one or several ratios of true to stated error; NaN if no error
        is stated.
    count : int
        Number of seeds.
    """

    name: str
    deviations: Callable[[int], Mapping[str, Any]]
    count: int = 200

    def measured(self) -> list[IntervalRow]:
        """Measure the case, and return a row for each quantity."""
        start = time.process_time()
        deviations: dict[str, list[float]] = {}
        for seed in range(FIRST_SEED, FIRST_SEED + self.count):
            for figure, deviation in self.deviations(seed).items():
                deviations.setdefault(figure, []).extend(np.atleast_1d(deviation).tolist())
        seconds = time.process_time() - start
        rows = []
        for figure, values in deviations.items():
            ratios = np.array([value for value in values if not math.isnan(value)])
            within, ratio = float(np.mean(np.abs(ratios) <= 2)), float(np.sqrt(np.mean(ratios**2)))
            rows.append(IntervalRow(self.name, figure, len(ratios), len(values) - len(ratios), within, ratio, seconds))
        return rows


def interval_cases(only: str | None = None) -> list[IntervalCase]:
    """Select the cases whose names contain a pattern with the wildcards * and ?, in the order of the table."""
    cases = [IntervalCase(*case, count) for family, count in FAMILIES for case in family().items()]
    return matching(cases, only)


def named_below(rows: Sequence[IntervalRow]) -> str:
    """A sentence that names the quantities with less than the allowed coverage, and states how many are expected by
    chance.

    The expected number is a sum over all rows: of the binomial probability that so few intervals contain the true value
    although the true coverage is 95.4 %.
    """
    from scipy.stats import binom

    least = TWICE - ALLOWED
    below = [f"{row.figure} of {row.case.partition(': ')[2]} ({row.within:.1%})" for row in rows if row.within < least]
    by_chance = sum(float(binom.cdf(math.ceil(least * row.made) - 1, row.made, TWICE)) for row in rows)
    words = f"By chance, {by_chance:.1f} such results are expected if the true coverage is 95.4 %."
    return f"Results with less: {'; '.join(below)}. {words}" if below else f"No result has less. {words}"


def summary(rows: Sequence[IntervalRow]) -> str:
    """Summarise rows: the number of quantities whose stated errors are large enough."""
    good = sum(row.within >= TWICE - ALLOWED for row in rows)
    within = np.average([row.within for row in rows], weights=[row.made for row in rows]) if rows else math.nan
    return (
        f"For {good} of {len(rows)} results, at least {TWICE - ALLOWED:.1%} of the true errors are within twice the "
        f"stated error; over all results, {within:.1%} are."
    )
