"""The page of `taxel bench coverage`, and the files of its three tables: readings, results without a pad ("figures"),
and probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.convergence import ORDER
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.coverage.coverage_cases import COARSER, FINE, FINER, REFINEMENTS
from mitsuba_taxel.evidence.coverage.coverage_row import CoverageRow, summary
from mitsuba_taxel.evidence.extremes.tables import LEFT
from mitsuba_taxel.evidence.intervals import intervals, probabilities
from mitsuba_taxel.evidence.intervals.intervals import IntervalRow
from mitsuba_taxel.evidence.intervals.probabilities import ProbabilityRow
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.evidence.rows.row_files import command_of, read_all_rows, write_rows

_READINGS = """\
# Stated and true errors

For users who ask how often the true value lies within the stated error.

**{summary}**

Written by `{command}`; do not edit by hand. The page has three parts: readings, results that need no pad, and
probabilities.

## Readings

The table has one row for each setting: a sensor whose readings are computed on the default mesh, with their stated
errors. The true error is the difference from a reference value on much smaller elements, which is explained below the
table:

{table}

- **true**, **stated**: true and stated relative error of the worst taxel due to the finite elements.
- **corrected**: true error if the estimated error, with its sign, were subtracted from the reading. If it exceeds the
  true error, the estimate has the wrong sign, or more than twice the right size. Readings are not corrected.
- **light**: stated relative error of the light, due to its patches.
- **extrapolation**: relative change of the reference value by the extrapolation.
- **within twice**: number of readings whose true error is at most twice the stated error.
- **CPU s**: CPU time of all processors, for all three meshes.

**Reference values.** A reference value is extrapolated to elements of size 0 from readings on two meshes. The finer
mesh has elements of {fine:g} mm or less, and at most 1 / {finer:g} of the default size. The elements of the other are
{coarser:.2f} times as large, or larger if fillets would leave both meshes nearly the same. The error is assumed to fall
with the power {order:g} of the element size. Light is computed without random numbers, with the same patches on all
meshes.

**Exceptions.** If such elements would take too long, the setting names the size that its reference has instead, as in
"(reference: 0.75 mm)"; under an indenter, all elements are smaller in proportion. If the extrapolation exceeds the
stated error, the elements of the reference are made smaller by the factor {coarser:.2f}, up to {refinements} times.
"""
_FIGURES = """
## Results that need no pad

**{summary}** {below}

The table has one row for each result that is computed from synthetic data, whose true value is known. Each row counts
errors over many random seeds, which are used for nothing else. If the stated errors are right, 95.4 % of the true
errors are within twice the stated error. Half the width of a stated 95 % interval counts as 1.96 standard deviations.

{table}

- **stated errors**, **not stated**: number of results with a stated error, and of results without one because the noise
  is unknown.
- **coverage**: fraction of the true errors within twice the stated error.
- **true / stated**: root mean square, over the seeds, of the true error divided by the stated error. A single seed with
  a stated error that is far too small can make this number large although the coverage is high. This happens where
  steps of a converter hide the noise.

The rows are of these kinds:

- **Recordings of a bench** (*record*). The force moves in stairs, ramps, triangles, sines, or ramps and holds
  (*mixture*), with random numbers of levels and rows. The noise is white, or correlated from row to row. Some rows have
  a 12-bit converter, whose steps hide the noise or are as large as the noise.
- **Tolerance studies**: sums and products of normally distributed parameters, with noise.
- **Fits** of a curve to readings under known forces. The unknowns are *softness* (displacement per force), *gain* (a
  factor of all readings) and *offset*. The model is exact, or has errors of light or finite elements. Errors of
  elements are proportional to the displacement, or change along the load path in a random walk. In some rows, the
  unknowns are correlated, or a bound is near the true value.
- **Calibrations** from load paths, tested on new paths. Errors are common to a path, or independent from row to row.
- **Exported models** of studies with errors, and forces computed from noisy counts.
- **Differences of two variants** of a sensor by `taxel compare`. Their readings have partly common errors, which are
  equal along a load path or random. The result *behind* is the difference between the variants in the figure of merit
  that the row names.

The figures of merit (`mean_slope`, `max_slope`, `zero_slope`, `relative_slope`, `nonlinearity`, `hysteresis`,
`repeatability`) are defined in [Figures of merit](theory/merit.md).
"""
_PROBABILITIES = """
## Probabilities

**{summary}**

`taxel compare` ranks three synthetic variants of a sensor, with errors as above, by one figure of merit and with a
limit on another. Two events are counted: a variant is the best (**first**), and a variant meets the limit
(**allowed**).

The table has one row for each event and each range of stated probabilities. It compares the stated probability with the
observed frequency:

{table}

- **stated**, **number**: range of stated probabilities, and number of probabilities in this range.
- **1 sigma**: standard error of the observed frequency, if all stated probabilities are right.
"""


class CoveragePage:
    """The page and its three tables. Each table is stored in its own file, so that one can be renewed without the
    others.

    Parameters
    ----------
    csv_file : Path or None
        File of the readings, such as ``coverage.csv``. The files ``coverage_figures.csv`` and
        ``coverage_probabilities.csv`` beside it have the other two tables. Rows of existing files are read.
    markdown : Path or None
        Page, which is rewritten whenever a row changes.

    Raises
    ------
    InputError
        if a file exists and is of another table.
    """

    def __init__(self, csv_file: Path | None, markdown: Path | None) -> None:
        self._csv, self._markdown = csv_file, markdown
        self._readings = self._kept(CoverageRow, csv_file)
        self._figures: list[IntervalRow] = self._kept(IntervalRow, self._beside("figures"))
        self._probabilities: list[ProbabilityRow] = self._kept(ProbabilityRow, self._beside("probabilities"))

    @staticmethod
    def _kept(kind: type[Any], file: Path | None) -> list[Any]:
        return read_all_rows(file, kind) if file and file.exists() else []

    def _beside(self, table: str) -> Path | None:
        return self._csv.with_name(f"{self._csv.stem}_{table}.csv") if self._csv else None

    def keep_readings(self, rows: Sequence[CoverageRow]) -> None:
        """Replace all rows of the table of readings, and rewrite the page. The CSV file of these rows is written by
        `ResumedTable`.
        """
        self._readings = list(rows)
        self._write()

    def keep_figures(self, rows: Sequence[IntervalRow]) -> None:
        """Replace rows of the table of results without a pad, of one or more cases, and rewrite its CSV file and the
        page.
        """
        names = [case.name for case in intervals.interval_cases()]
        self._figures = _in_order(self._figures, rows, names)
        self._store(self._figures, "figures")

    def keep_probabilities(self, rows: Sequence[ProbabilityRow]) -> None:
        """Replace rows of the table of probabilities, of one or more cases, and rewrite its CSV file and the page."""
        names = [case.name for case in probabilities.chosen_cases()]
        self._probabilities = _in_order(self._probabilities, rows, names)
        self._store(self._probabilities, "probabilities")

    def _store(self, rows: Sequence[Any], table: str) -> None:
        if file := self._beside(table):
            write_rows(rows, file)
        self._write()

    def _write(self) -> None:
        """Write the page; a table without rows has no section."""
        if self._markdown is None:
            return
        text = _READINGS.format(
            command=command_of("coverage", self._csv, self._markdown),
            fine=FINE,
            finer=FINER,
            coarser=COARSER,
            refinements=REFINEMENTS,
            order=ORDER,
            summary=summary(self._readings),
            table=markdown_table(headings(CoverageRow), map(cells, self._readings), LEFT),
        )
        if self._figures:
            text += _FIGURES.format(
                summary=intervals.summary(self._figures),
                below=intervals.named_below(self._figures),
                table=markdown_table(headings(IntervalRow), map(cells, self._figures), headings(IntervalRow)[:2]),
            )
        if self._probabilities:
            rows = probabilities.with_all_kinds(self._probabilities)
            text += _PROBABILITIES.format(
                summary=probabilities.summary(rows),
                table=markdown_table(headings(ProbabilityRow), map(cells, rows), headings(ProbabilityRow)[:3]),
            )
        write_text(self._markdown, text)


def _in_order(kept: Sequence[Any], rows: Sequence[Any], names: Sequence[str]) -> list[Any]:
    """Merge new ``rows`` into stored rows, in the order of the case names ``names``.

    New rows replace stored rows of the same case. Stored rows of cases that no longer exist are dropped.
    """
    renewed = {row.case for row in rows}
    all_rows = [row for row in kept if row.case not in renewed and row.case in names] + list(rows)
    return sorted(all_rows, key=lambda row: names.index(row.case))
