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
"""In bytes of address space: for ten cells on elements of 0.4 mm, solvers reserve over 16 GB and use about 3 GB."""

_PAGE = """\
# Stated and true errors

For users who ask how often the true reading is within the stated error.

Written by `{command}`; do not edit by hand.

Each setting is read on the default mesh, which gives the stated error of the finite elements. The truth is read on
elements of {fine:g} mm or less (at most 1 / {finer:g} of the default size), and extrapolated from these and from
elements {coarser:.2f} times as large, with an error that falls with the power {order:g} of their size. Light is
computed without random numbers, by the same patches on all meshes.

**{summary}**

{table}

- **true**, **stated**: relative error of the worst taxel due to the finite elements.
- **corrected**: true error after the signed estimate of the second mesh is subtracted from the reading.
- **light**: error stated for the patches of the light. **truth extrapolated by**: change of the truth by the
  extrapolation from the finest elements.
- **within twice**: number of readings whose true error is within twice the stated error.
- **CPU s**: time of all processors, for all three meshes.
"""
_INTERVALS = """
## Figures that need no pad

Each row is a kind of synthetic data whose truth is known:

- recordings of a bench: the force moves in stairs, ramps, triangles, sines, or ramps and holds, with random numbers of
  levels and rows; the noise is white, correlated from row to row, or below or above the steps of a 12-bit converter;
- tolerance studies: sums and products of normal parameters, with noise;
- fits of a curve: by the right model, by a model with errors of light and finite elements, with correlated unknowns,
  and with a bound near the truth;
- calibrations: by paths whose errors are common to a path or independent from row to row, tested on new paths;
- exported models of studies with errors; forces computed from noisy counts;
- differences of two variants of a sensor by `taxel compare`: their readings have partly common errors, either equal
  along a path or random.

Errors of figures are counted over random seeds that are used for nothing else; 95.4 % should be within twice the stated
error (intervals are converted to it).

**{summary}**

{table}

- **coverage**: fraction of errors within twice the stated error. **none stated**: the noise is unknown.
- **true / stated**: root mean square over the seeds; 1 if stated errors are as large as true errors.
"""
_PROBABILITIES = """
## Probabilities

Three variants of a sensor, with synthetic figures and errors as above, are ranked by one figure with `taxel compare`,
with a limit on another. The table compares the stated probabilities of being first, and of being within the limit
(**allowed**), with the observed frequencies.

**{summary}**

{table}

- **1 sigma**: standard error of the observed frequency, if all probabilities are right.
"""


def coverage(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[CoverageRow]:
    """Yield rows of the table as they are measured, each in its own process.

    Parameters
    ----------
    only, csv_file, markdown, starting
        See `ResumedTable.rows`.

    Returns
    -------
    Iterator[CoverageRow]
        In the order of the table; none if the pattern selects figures that need no pad.
    """
    if interval_cases(only) and only:
        return iter(())
    table = ResumedTable(
        "coverage",
        coverage_cases(),
        CoverageRow,
        lambda case: measure_isolated(case, MOST_SECONDS, MOST_MEMORY),
        write_page,
        repeats=lambda row: bool(row.remark),
    )
    return table.rows(only, csv_file, markdown, starting)


def summary(rows: Sequence[CoverageRow]) -> str:
    """Sentences with the number of readings within twice their stated error, and the mean errors."""
    read = [row for row in rows if row.within == row.within]
    readings, within = sum(row.readings for row in read), sum(row.within for row in read)
    unread = f"; {len(rows) - len(read)} settings could not be read" if len(read) < len(rows) else ""
    percentage = f" ({within / readings:.1%})" if readings else ""
    true, corrected = (root_mean_square([getattr(row, name) for row in read]) for name in ("true", "corrected"))
    return (
        f"{within:.0f} of {readings:.0f} readings{percentage} in {len(read)} settings are within twice{unread}. Root "
        f"mean square of the worst taxels: true {true:.3%}, corrected {corrected:.3%}."
    )


def root_mean_square(values: Sequence[float]) -> float:
    return math.sqrt(sum(value**2 for value in values) / len(values)) if values else math.nan


def write_page(
    rows: Sequence[CoverageRow],
    file: Path,
    command: str,
    counted: Sequence[IntervalRow] = (),
    probabilities: Sequence[ProbabilityRow] = (),
) -> None:
    """Write rows as a page that explains its columns.

    Parameters
    ----------
    rows : sequence of CoverageRow
        Readings of pads.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its origin.
    counted : sequence of IntervalRow
        Figures that need no pad; without any, the page has no such section.
    probabilities : sequence of ProbabilityRow
        Probabilities of `taxel compare`; without any, the page has no such section.
    """
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
