"""The table of figures of merit of scenes drawn at random, at three target errors, against those on finer elements."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from mitsuba_taxel.base.atomic import write_text
from mitsuba_taxel.base.convergence import ORDER
from mitsuba_taxel.base.markdown import markdown_table
from mitsuba_taxel.evidence.coverage.figure_cases import FINE, LOADS, POINTS, figure_cases
from mitsuba_taxel.evidence.coverage.figure_row import FIGURES, TARGETS, FigureRow
from mitsuba_taxel.evidence.rows.isolated_process import measure_isolated
from mitsuba_taxel.evidence.rows.row_files import ResumedTable

MOST_SECONDS = 1800.0
NAMES = {"default": "default", "permille_2": "0.2 %", "permille_1": "0.1 %"}
"""Target errors in words."""
HEADINGS = ("scene", *(f"{figure}, {NAMES[t]}" for figure in ("nonlinearity", "max_slope") for t in TARGETS),
            "truth [mm]", "CPU s", "of these truth", "remark")  # fmt: skip
COUNTS = ("figure", "target", "figures", "within once", "within twice", "stated / true, median", "worst")

_PAGE = """\
# Figures of scenes drawn at random

Written by `{command}`; do not edit by hand.

Pads of one or two cells with shapes, dimensions, walls, LED, material and loads drawn at random from a seed: of ten
scenes about seven under a normal force, one under a tangential one, one whose roof is a rough mirror and needs random
paths, and one of viscoelastic silicone, loaded and unloaded. Each is swept over {loads} loads at the default settings
and to target errors of 0.2 % and 0.1 %. Figures of merit and their stated errors are those of the first taxel, as by
`taxel characterise`.

The truth is not a sweep to 0.03 %, which would take many minutes each. It is extrapolated, reading by reading, from
elements of {fine:g} mm or less (1.41 times smaller than those of the sweep to 0.1 %, if these are smaller), and 1.41
times as large, with an error that falls with the power {order:g} of their size. Its largest and zero slopes are those
of the polynomial through all its readings where the sweeps have derivatives, and as in the sweeps where they have none.
Its light is by the same patches as that of the sweeps, or by {points} random paths for each randomisation, of another
seed.

Of {every} scenes {measured} have been measured so far; the command goes on with the others. The last is of an earlier
draw: its default elements and those of twice their size differ by a third of the error only. Where the default settings
meet a target, that sweep is the same one, and its figures are counted again; the four slopes of a scene are nearly the
same number. The error of the truth itself, from 0.5 to 2 % of a slope in some scenes, is not in the comparison.

**{summary}**

{counts}

Errors of the figures of each scene over what is stated:

{table}

- **figures**: of scenes that have it. **worst**: largest true error over the stated one.
- **truth [mm]**: its finest elements. **CPU s**: of all processors.
"""


def figures(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[Any]:
    """Rows of the table as they are measured, each in a process of its own; see `ResumedTable.rows`."""
    made = ResumedTable(
        "figures", figure_cases(), FigureRow, lambda case: measure_isolated(case, MOST_SECONDS), write_page
    )
    return made.rows(only, csv_file, markdown, starting)


def deviations(rows: Sequence[Any], figure: str, target: str) -> list[float]:
    """Magnitudes of the errors over the stated ones, of the scenes that have the figure."""
    every = [abs(row.deviation(figure, target)) for row in rows]
    return [value for value in every if not math.isnan(value)]


def counts(rows: Sequence[Any]) -> list[list[str]]:
    """Cells of a row for each figure and target: how many errors are within once and twice the stated one, the median
    of stated over true errors, and the largest of true over stated ones."""
    found = []
    for figure in FIGURES:
        for target in TARGETS:
            values = deviations(rows, figure, target)
            if values:
                ratio = median(1 / value if value else math.inf for value in values)
                found.append([
                    figure, NAMES[target], f"{len(values)}", *(f"{sum(v <= n for v in values)}" for n in (1, 2)),
                    f"{ratio:.1f}", f"{max(values):.2f}",
                ])  # fmt: skip
    return found


def summary(rows: Sequence[Any]) -> str:
    """Sentences with the number of figures within their errors, and the costs."""
    every = [value for figure in FIGURES for target in TARGETS for value in deviations(rows, figure, target)]
    read = [row for row in rows if not row.remark]
    if not every:
        return f"None of {len(rows)} scenes could be read."
    within = sum(value <= 2 for value in every)
    ratio = median(1 / value if value else math.inf for value in every)
    lacking = f"; {len(rows) - len(read)} scenes could not be read" if len(read) < len(rows) else ""
    return (
        f"{within} of {len(every)} figures ({within / len(every):.1%}) of {len(read)} scenes are within twice the "
        f"stated error, which is {ratio:.1f} times the true one in the median{lacking}."
    )


def cells(row: Any) -> list[str]:
    """The cells of a scene in the second table."""
    ratios = [row.deviation(figure, target) for figure in ("nonlinearity", "max_slope") for target in TARGETS]
    costs = ((row.fine, 2), (row.seconds + row.true_seconds, 0), (row.true_seconds, 0))
    return [
        row.case,
        *("-" if math.isnan(ratio) else f"{ratio:.2f}" for ratio in ratios),
        *("-" if math.isnan(number) else f"{number:.{digits}f}" for number, digits in costs),
        row.remark or "-",
    ]


def write_page(rows: Sequence[Any], file: Path, command: str) -> None:
    """Write the rows as a page with an explanation of its columns."""
    text = _PAGE.format(
        command=command,
        every=len(figure_cases()),
        measured=len(rows),
        loads=LOADS,
        fine=FINE,
        order=ORDER,
        points=POINTS,
        summary=summary(rows),
        counts=markdown_table(COUNTS, counts(rows), COUNTS[:2]),
        table=markdown_table(HEADINGS, map(cells, rows), ("scene", "remark")),
    )
    write_text(file, text)
