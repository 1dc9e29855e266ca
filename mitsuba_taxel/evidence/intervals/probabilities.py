"""Stated probabilities against how often they come true, counted on made-up truth."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import ClassVar

import numpy as np

from mitsuba_taxel.evidence.intervals.comparisons import Truth, probability_cases
from mitsuba_taxel.evidence.intervals.intervals import FIRST_SEED

EDGES = (0.02, 0.2, 0.4, 0.6, 0.8, 0.98)
"""Of the ranges of probabilities; what is stated to be nearly sure or excluded is counted apart."""
SEEDS = 80
SIGMAS = 3.0
"""Standard errors of a share by which it may deviate from the mean of the stated probabilities."""
SLACK = 0.03
"""Allowed deviation beyond that, as for intervals."""


@dataclass(frozen=True)
class ProbabilityRow:
    """How often probabilities of a range come true.

    Attributes
    ----------
    stated : str
        The range.
    made : float
        Number of stated probabilities in it.
    mean, true : float
        Mean of these, and share of those that came true.
    noise : float
        Standard error of that share, if probabilities are right.
    """

    COLUMNS: ClassVar = {
        "case": ("made up", ""),
        "figure": ("probability", ""),
        "stated": ("stated", ""),
        "made": ("number", ".0f"),
        "mean": ("mean of stated", ".1%"),
        "true": ("came true", ".1%"),
        "noise": ("1 sigma of that", ".1%"),
        "seconds": ("CPU s", ".0f"),
    }
    case: str
    figure: str
    stated: str
    made: float
    mean: float
    true: float
    noise: float
    seconds: float = math.nan

    @property
    def holds(self) -> bool:
        """Whether the share is that of right probabilities, but for noise and the allowed deviation."""
        return abs(self.true - self.mean) <= SIGMAS * self.noise + SLACK


@dataclass(frozen=True)
class ProbabilityCase:
    """A kind of made-up truth.

    Attributes
    ----------
    name : str
    outcomes : Callable[[int], dict[str, (ndarray, ndarray)]]
        Of a seed, by what is stated: probabilities, and whether they came true.
    count : int
        Number of seeds.
    """

    name: str
    outcomes: Callable[[int], Mapping[str, Truth]]
    count: int = SEEDS

    def measured(self) -> list[ProbabilityRow]:
        """One row per range that has a probability."""
        began = time.process_time()
        found: dict[str, list[Truth]] = {}
        for seed in range(FIRST_SEED, FIRST_SEED + self.count):
            for figure, outcome in self.outcomes(seed).items():
                found.setdefault(figure, []).append(outcome)
        seconds, rows = time.process_time() - began, []
        for figure, outcomes in found.items():
            stated, true = (np.concatenate(column) for column in zip(*outcomes, strict=True))
            for low, high in zip((0.0, *EDGES), (*EDGES, 1.0), strict=True):
                inside = (stated >= low) & ((stated < high) | (high == 1.0))
                if not inside.any():
                    continue
                p, came = stated[inside], true[inside]
                noise = math.sqrt(float(np.sum(p * (1 - p)))) / len(p)
                words = f"{100 * low:.0f} to {100 * high:.0f} %"
                numbers = (len(p), float(p.mean()), float(came.mean()), noise, seconds)
                rows.append(ProbabilityRow(self.name, figure, words, *numbers))
        return rows


def probability_rows(
    only: str | None = None, starting: Callable[[str], None] | None = None
) -> Iterator[ProbabilityRow]:
    """Rows of the table as they are measured, of cases whose name contains a pattern; of several, those of all last."""
    made: list[ProbabilityRow] = []
    for case in (cases := chosen_cases(only)):
        if starting:
            starting(f"{case.name}, probabilities")
        rows = case.measured()
        made += rows
        yield from rows
    if len(cases) > 1:
        yield from pooled(made)


def pooled(rows: Sequence[ProbabilityRow]) -> list[ProbabilityRow]:
    """Rows of all kinds together, by figure and range.

    A kind alone has some 15 probabilities in a range, whose share that comes true has a standard error of 12 points.
    """
    groups: dict[tuple[str, str], list[ProbabilityRow]] = {}
    for row in rows:
        groups.setdefault((row.figure, row.stated), []).append(row)
    together = []
    for (figure, stated), each in sorted(groups.items(), key=lambda group: (group[0][0] != "first", group[1][0].mean)):
        count = np.array([row.made for row in each])
        mean, true = (float(count @ [getattr(row, name) for row in each] / count.sum()) for name in ("mean", "true"))
        noise = math.sqrt(float(np.sum((count * [row.noise for row in each]) ** 2))) / float(count.sum())
        seconds = sum(row.seconds for row in each)
        together.append(ProbabilityRow("all kinds", figure, stated, float(count.sum()), mean, true, noise, seconds))
    return together


def chosen_cases(only: str | None = None) -> list[ProbabilityCase]:
    """The kinds whose name contains a pattern with the wildcards * and ?."""
    every = [ProbabilityCase(name, outcomes) for name, outcomes in probability_cases().items()]
    return [case for case in every if only is None or fnmatchcase(case.name, f"*{only}*")]


def summary(rows: Sequence[ProbabilityRow]) -> str:
    """A sentence with the number of ranges whose probabilities hold."""
    good = sum(row.holds for row in rows)
    return (
        f"Of {len(rows)} ranges of probabilities, {good} come true as often as stated, within {SIGMAS:g} standard "
        f"errors of the count and {100 * SLACK:g} points."
    )
