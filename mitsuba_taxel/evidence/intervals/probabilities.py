"""Table of stated probabilities of events and their observed frequencies, on synthetic data."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mitsuba_taxel.evidence.intervals.comparisons import Truth, probability_cases
from mitsuba_taxel.evidence.intervals.intervals import FIRST_SEED
from mitsuba_taxel.evidence.rows.row_files import matching

EDGES = (0.02, 0.2, 0.4, 0.6, 0.8, 0.98)
"""Edges of the ranges of probabilities; the outermost ranges are those of almost certain events."""
SEEDS = 80
SIGMAS = 3.0
"""Allowed deviation of a frequency from the mean stated probability, in standard errors of the frequency."""
SLACK = 0.03
"""Additional allowed deviation, as for intervals."""


@dataclass(frozen=True)
class ProbabilityRow:
    """Observed frequency of events whose stated probabilities lie in one range.

    Attributes
    ----------
    stated : str
        Range of the stated probabilities.
    made : float
        Number of stated probabilities in the range.
    mean, true : float
        Mean of the stated probabilities, and observed frequency of the events.
    noise : float
        Standard error of the observed frequency, if the stated probabilities are right.
    """

    COLUMNS: ClassVar = {
        "case": ("synthetic data", ""),
        "figure": ("probability", ""),
        "stated": ("stated", ""),
        "made": ("number", ".0f"),
        "mean": ("mean of stated", ".1%"),
        "true": ("observed frequency", ".1%"),
        "noise": ("1 sigma", ".1%"),
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
        """Whether the observed frequency agrees with the mean probability, within its noise and an allowed
        deviation."""
        return abs(self.true - self.mean) <= SIGMAS * self.noise + SLACK


@dataclass(frozen=True)
class ProbabilityCase:
    """One kind of synthetic data, for which stated probabilities of events are compared with how often they occur.

    Attributes
    ----------
    name : str
        Name in the table.
    outcomes : Callable[[int], dict[str, (ndarray, ndarray)]]
        Returns, for a seed and by name of the event, stated probabilities and whether each event occurred.
    count : int
        Number of seeds.
    """

    name: str
    outcomes: Callable[[int], Mapping[str, Truth]]
    count: int = SEEDS

    def measured(self) -> list[ProbabilityRow]:
        """Measure the case, and return a row for each event and each range that contains a probability."""
        # Probabilities and outcomes of all seeds, by event.
        start = time.process_time()
        collected: dict[str, list[Truth]] = {}
        for seed in range(FIRST_SEED, FIRST_SEED + self.count):
            for figure, outcome in self.outcomes(seed).items():
                collected.setdefault(figure, []).append(outcome)
        seconds, rows = time.process_time() - start, []
        # Count them by range.
        for figure, outcomes in collected.items():
            probability, true = (np.concatenate(column) for column in zip(*outcomes, strict=True))
            for low, high in zip((0.0, *EDGES), (*EDGES, 1.0), strict=True):
                inside = (probability >= low) & ((probability < high) | (high == 1.0))
                if not inside.any():
                    continue
                p, came_true = probability[inside], true[inside]
                noise = math.sqrt(float(np.sum(p * (1 - p)))) / len(p)
                label = f"{100 * low:.0f} to {100 * high:.0f} %"
                numbers = (len(p), float(p.mean()), float(came_true.mean()), noise, seconds)
                rows.append(ProbabilityRow(self.name, figure, label, *numbers))
        return rows


def chosen_cases(only: str | None = None) -> list[ProbabilityCase]:
    """Select the cases whose names contain a pattern with the wildcards * and ?, in the order of the table."""
    return matching([ProbabilityCase(name, outcomes) for name, outcomes in probability_cases().items()], only)


def with_all_kinds(rows: Sequence[ProbabilityRow]) -> list[ProbabilityRow]:
    """Append to the rows of several cases the rows of all cases together; the rows of a single case are returned
    unchanged."""
    return [*rows, *(pooled(rows) if len({row.case for row in rows}) > 1 else [])]


def pooled(rows: Sequence[ProbabilityRow]) -> list[ProbabilityRow]:
    """Combine the rows of all cases: one row for each event and range.

    A single case has about 15 probabilities in a range, so that the standard error of its observed frequency is 12
    percentage points.
    """
    groups: dict[tuple[str, str], list[ProbabilityRow]] = {}
    for row in rows:
        groups.setdefault((row.figure, row.stated), []).append(row)
    together = []
    for (figure, label), group in sorted(groups.items(), key=lambda item: (item[0][0] != "first", item[1][0].mean)):
        count = np.array([row.made for row in group])
        mean, true = (float(count @ [getattr(row, name) for row in group] / count.sum()) for name in ("mean", "true"))
        noise = math.sqrt(float(np.sum((count * [row.noise for row in group]) ** 2))) / float(count.sum())
        seconds = sum(row.seconds for row in group)
        together.append(ProbabilityRow("all kinds", figure, label, float(count.sum()), mean, true, noise, seconds))
    return together


def summary(rows: Sequence[ProbabilityRow]) -> str:
    """Summarise rows: the number of ranges in which the observed frequency agrees with the stated probability."""
    good = sum(row.holds for row in rows)
    return (
        f"In {good} of {len(rows)} ranges of probabilities, the observed frequency differs from the mean stated "
        f"probability by at most {SIGMAS:g} standard errors (1 sigma) plus {100 * SLACK:g} percentage points."
    )
