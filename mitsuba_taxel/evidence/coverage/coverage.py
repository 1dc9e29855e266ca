"""The table of stated and true errors of readings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from mitsuba_taxel.base.convergence import ORDER
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.coverage.coverage_cases import COARSER, FINE, FINER, coverage_cases
from mitsuba_taxel.evidence.coverage.coverage_row import CoverageRow
from mitsuba_taxel.evidence.extremes.tables import LEFT
from mitsuba_taxel.evidence.intervals.intervals import IntervalRow, interval_cases
from mitsuba_taxel.evidence.intervals.intervals import summary as summary_of_intervals
from mitsuba_taxel.evidence.intervals.probabilities import ProbabilityRow
from mitsuba_taxel.evidence.intervals.probabilities import summary as summary_of_probabilities
from mitsuba_taxel.evidence.rows.isolated_process import measure_isolated
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.evidence.rows.row_files import ResumedTable

MOST_SECONDS = 3600.0
MOST_MEMORY = 48 * 2**30
"""In bytes: solvers reserve over 16 GB for ten cells on elements of 0.4 mm, and use some 3 GB of it."""

_PAGE = """\
# Stated and true errors

Written by `{command}`; do not edit by hand.

Each setting is read on the default mesh, with the error that it states for the finite elements, and on elements of
{fine:g} mm or less (at most 1 / {finer:g} of the reading's), extrapolated from these and from elements {coarser:.2f}
times as large with an error that falls with the power {order:g} of their size. Light is computed without random
numbers, by patches that are the same on all elements.

**{summary}**

{table}

- **true**, **stated**: relative error of the worst taxel due to the finite elements.
- **corrected**: the same if the error that the second mesh shows, with its sign, is subtracted from the reading.
- **light**: stated for the patches of the light. **truth extrapolated by**: error of the finest elements themselves.
- **within twice**: readings whose true error is within twice the stated one.
- **CPU s**: time of all processors, for all three meshes.
"""
_INTERVALS = """
## Figures that need no pad

Each row is a kind of made-up truth: recordings of a bench whose force moves in stairs, ramps, triangles, sines or a
mixture of ramps and holds, of random numbers of levels and rows, with noise that is white, correlated from row to row,
or below or above the steps of a converter of 12 bits; tolerance studies of sums and products of normal
parameters with noise; fits of a bent curve by a right model, by one with errors of light and finite elements, of
correlated unknowns, and with a bound near the truth; calibrations by paths with errors that are common to a path or of
single rows, tested on new paths; exported models of studies with errors; forces read from noisy counts; and differences
of two variants of a sensor by `taxel compare`, whose readings have errors, common to a path or of a random course,
that the variants partly share. Errors of figures are counted over random seeds that served for nothing else; 95.4 %
should be within twice what is stated (intervals are converted to it).

**{summary}**

{table}

- **coverage**: share of errors within twice the stated one. **none stated**: where the noise is not known.
- **true / stated**: root mean square over the seeds; 1 if stated errors are as large as true ones.
"""
_PROBABILITIES = """
## Probabilities

Three variants of a sensor with made-up figures and errors as above are ranked by `taxel compare`, with a limit of the
other figure: the probability of being the first, and of being within the limit (**allowed**), against how often either
is so.

**{summary}**

{table}

- **1 sigma**: standard error of the share that came true, if all probabilities are right.
"""


def coverage(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[CoverageRow]:
    """Rows of the table as they are measured, each in a process of its own; see `ResumedTable.rows`."""
    if interval_cases(only) and only:
        return iter(())
    made = ResumedTable(
        "coverage",
        coverage_cases(),
        CoverageRow,
        lambda case: measure_isolated(case, MOST_SECONDS, MOST_MEMORY),
        write_page,
        repeats=lambda row: bool(row.remark),
    )
    return made.rows(only, csv_file, markdown, starting)


def summary(rows: Sequence[CoverageRow]) -> str:
    """Sentences with the number of readings within twice their stated error, and the mean errors."""
    told = [row for row in rows if row.within == row.within]
    readings, within = sum(row.readings for row in told), sum(row.within for row in told)
    untold = f"; {len(rows) - len(told)} settings could not be read" if len(told) < len(rows) else ""
    share = f" ({within / readings:.1%})" if readings else ""
    true, corrected = (_root_mean_square([getattr(row, name) for row in told]) for name in ("true", "corrected"))
    return (
        f"{within:.0f} of {readings:.0f} readings{share} in {len(told)} settings are within twice{untold}. Root mean "
        f"square of the worst taxels: true {true:.3%}, corrected {corrected:.3%}."
    )


def _root_mean_square(values: Sequence[float]) -> float:
    return math.sqrt(sum(value**2 for value in values) / len(values)) if values else math.nan


def write_page(
    rows: Sequence[CoverageRow],
    file: Path,
    command: str,
    counted: Sequence[IntervalRow] = (),
    probabilities: Sequence[ProbabilityRow] = (),
) -> None:
    """Write the rows as a page with an explanation of its columns, and those of figures that need no pad."""
    text = _PAGE.format(
        command=command,
        fine=FINE,
        finer=FINER,
        coarser=COARSER,
        order=ORDER,
        summary=summary(rows),
        table=markdown_table(headings(CoverageRow), map(cells, rows), LEFT),
    )
    if counted:
        text += _INTERVALS.format(
            summary=summary_of_intervals(counted),
            table=markdown_table(headings(IntervalRow), map(cells, counted), headings(IntervalRow)[:2]),
        )
    if probabilities:
        text += _PROBABILITIES.format(
            summary=summary_of_probabilities(probabilities),
            table=markdown_table(headings(ProbabilityRow), map(cells, probabilities), headings(ProbabilityRow)[:3]),
        )
    write_text(file, text)
