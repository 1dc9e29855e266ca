"""Table and page of `taxel bench figures`: figures of merit of random scenes at three target errors, compared with
reference values from finer elements."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from mitsuba_taxel.base.convergence import ORDER
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.characterise.shape_error import BY_STRAIN, COURSE
from mitsuba_taxel.evidence.coverage.figure_cases import FACTOR, FINE, FINE_RIM, LOADS, POINTS, SEED, figure_cases
from mitsuba_taxel.evidence.coverage.figure_row import FIGURES, TARGETS, FigureRow
from mitsuba_taxel.evidence.rows.isolated_process import measure_isolated
from mitsuba_taxel.evidence.rows.row_files import ResumedTable

MOST_SECONDS = 1800.0
NAMES = {"default": "default", "permille_2": "0.2 %", "permille_1": "0.1 %"}
"""Target errors in words."""
SHOWN = ("nonlinearity", "max_slope")
"""Figures of the table of scenes."""
HEADINGS = ("scene", *(f"{figure}, {NAMES[t]}" for figure in SHOWN for t in TARGETS),
            *(f"truth / stated, {figure}" for figure in SHOWN),
            "course", "strain", "truth [mm]", "CPU s", "of these truth", "remark")  # fmt: skip
COUNTS = ("figure", "target", "figures", "not judged", "within once", "within twice", "stated / true, median", "worst")

DIFFERENCE = math.sqrt(2 * (1 - math.exp(-1 / 2)))
"""Standard deviation of the change of a course from zero load to the largest load, if the course has standard deviation
1."""

_PAGE = """\
# Figures of scenes drawn at random

For users of slopes, nonlinearity and hysteresis who ask how well their stated errors hold.

Written by `{command}`; do not edit by hand.

Pads of one or two cells with shapes, dimensions, walls, LED, material and loads drawn at random from the seed {seed}:
of ten scenes, about seven have a normal force, one has a tangential force, one has a rough mirror as roof (which needs
random paths), and one is of viscoelastic silicone that is loaded and unloaded. Each is swept over {loads} loads at the
default settings and to target errors of 0.2 % and 0.1 %. Figures of merit and their stated errors are those of `taxel
characterise` for the first taxel. The ranges of the draw were changed once, after the first results, so that a scene
takes a minute rather than ten (sides reflect in a fifth of the scenes). They have been fixed since then: a test
compares the names of all scenes.

The truth is not a sweep to 0.03 %, which would take many minutes each. It is extrapolated, reading by reading, from
elements of {fine:g} mm or less (1.41 times smaller than those of the sweep to 0.1 %, if these are smaller), and 1.41
times as large, with an error that falls with the power {order:g} of their size. Spherical cells with an isotropic roof
have elements of {fine_rim:g} mm or less: such a roof bends into the cell along its rim, where points fall below each
other's horizons, in a strip that is as wide as an element. The nonlinearity of no. 03 is 0.310, 0.249, 0.242, 0.252,
0.262 and 0.270 % on elements of 0.6, 0.42, 0.3, 0.21, 0.15 and 0.11 mm. From those of 0.42 and 0.3 mm, a truth of
0.229 % was extrapolated, 2.2 stated errors off; from the smallest two it is 0.281 %, where 0.278 ± 0.022 % is stated.
The rule was made after such scenes had missed, on elements of 0.6 mm at first.{older}

Where the sweeps have derivatives, the largest slope and the slope at zero of the truth are those of the polynomial
through all its readings; elsewhere they are computed as in the sweeps. The light of the truth is computed with the same
patches as that of the sweeps, or by {points} random paths for each randomisation, of another seed. So the error of the
patches is not part of the comparison.

**The truth has an error** too: half of the change of a figure by the extrapolation, because the order of convergence
may be 1 or 2; at least 0.2 % of a slope, because two meshes may agree by chance; and the noise of random paths.
Deviations below are those of the sweep from the truth, divided by both errors combined. If the error of the truth
exceeds the stated error, and the deviation is within twice the combined error, the comparison says little about the
stated error: the figure is **not judged**, and all other counts exclude it.

Of {every} scenes {measured} have been measured so far; the command continues with the others. No. 41 is from an earlier
draw: there, elements of the default and of twice that size differ by only a third of the error. Nos. 42 to 45 are four
of the other scenes under {factor} times their loads. The model of the errors of nonlinearities was chosen with scenes
01 to 14 and 41; the others were measured afterwards, for the first time. Where the default settings meet a target, the
same sweep is used for it, and its figures are counted again. The four slopes of a scene are nearly the same number.

**{summary}**

{counts}

## How the error changes along a path

Elements that are too coarse change all readings of a path by nearly the same fraction of their change. The remainder is
the **course**: the ratio of true to stated error of a reading at the largest load, minus that ratio at the first load.
Figures of merit treat it as random, with a standard deviation of {course:g} of the stated error, or of {by_strain:g}
times the largest strain if that is more. From the first load to the last, the standard deviation is {difference:.2f}
times as large ([theory](theory/errors.md#figures-derived-from-readings)). {courses}

## Scenes

Deviations of the figures of each scene over both errors combined, and the error of the truth over the stated error at
the default settings:

{table}

- **figures**: number of scenes that have the figure. **stated / true**: both errors combined over the deviation.
  **worst**: largest deviation over both errors combined. **truth / stated**: error of the truth over the stated error;
  above 1, a figure may not be judged.
- **course**: see above. **strain**: largest strain.
- **truth [mm]**: size of the finest elements of the truth. **CPU s**: CPU time of all processors.
"""


def figures(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[Any]:
    """Yield rows of the table as they are measured, each in its own process.

    Parameters
    ----------
    only, csv_file, markdown, starting
        See `ResumedTable.rows`.

    Returns
    -------
    Iterator[FigureRow]
        Rows in the order of the table.
    """
    table = ResumedTable(
        "figures", figure_cases(), FigureRow, lambda case: measure_isolated(case, MOST_SECONDS), write_page
    )
    return table.rows(only, csv_file, markdown, starting)


def deviations(rows: Sequence[Any], figure: str, target: str) -> tuple[list[float], int]:
    """List the true errors of a figure of merit at one target error, each divided by the combined standard error of
    sweep and reference value.

    Parameters
    ----------
    rows : sequence of FigureRow
        Measured rows.
    figure, target : str
        Name of the figure of merit, one of `FIGURES`, and of the target error, one of `TARGETS`.

    Returns
    -------
    judged : list[float]
        Magnitudes of these ratios, for the scenes whose reference value is accurate enough for a comparison.
    unjudged : int
        Number of the other scenes with this figure.
    """
    with_error = [row for row in rows if not math.isnan(row.deviation(figure, target))]
    ratios = [(abs(row.deviation(figure, target)), row.weakness(figure, target)) for row in with_error]
    judged = [value for value, weakness in ratios if not weakness > 1 or value > 2]
    return judged, len(ratios) - len(judged)


def counts(rows: Sequence[Any]) -> list[list[str]]:
    """Count the comparisons of each figure of merit at each target error, as rows of a table in the order of `COUNTS`.

    A row has the number of figures, the number that are not judged, the numbers with an error within once and twice the
    combined standard error, the median ratio of stated to true error, and the largest ratio of true to stated error.
    """
    table = []
    for figure in FIGURES:
        for target in TARGETS:
            values, unjudged = deviations(rows, figure, target)
            if values or unjudged:
                ratio = median(1 / value if value else math.inf for value in values) if values else math.nan
                within, worst = [sum(value <= count for value in values) for count in (1, 2)], max(values, default=0.0)
                numbers = (len(values) + unjudged, unjudged, *within, f"{ratio:.1f}", f"{worst:.2f}")
                table.append([figure, NAMES[target], *map(str, numbers)])
    return table


def summary(rows: Sequence[Any]) -> str:
    """Summarise rows: the number of figures of merit within twice their stated errors."""
    pairs = [deviations(rows, figure, target) for figure in FIGURES for target in TARGETS]
    ratios, unjudged = [value for values, _ in pairs for value in values], sum(count for _, count in pairs)
    read = [row for row in rows if not row.remark]
    if not ratios:
        return f"None of {len(rows)} scenes could be read."
    within = sum(value <= 2 for value in ratios)
    ratio = median(1 / value if value else math.inf for value in ratios)
    lacking = f"; {unjudged} figures are not judged" if unjudged else ""
    lacking += f"; {len(rows) - len(read)} scenes could not be read" if len(read) < len(rows) else ""
    return (
        f"{within} of {len(ratios)} figures ({within / len(ratios):.1%}) of {len(read)} scenes are within twice the "
        f"stated error, which is {ratio:.1f} times the true one in the median{lacking}."
    )


def taken_course(strain: float) -> float:
    """Standard deviation that figures of merit assume for the change of a reading's error from the first load to the
    last, relative to the stated error."""
    return DIFFERENCE * min(max(COURSE, BY_STRAIN * strain), 1.0)


def courses(rows: Sequence[Any]) -> str:
    """Compare, in sentences, the change of the true error along the load path with the assumed change."""
    known = [row for row in rows if not math.isnan(row.course)]
    if not known:
        return "It is not known for any scene of these rows."
    sizes = [abs(row.course) for row in known]
    ratios = [size / taken_course(row.strain) for size, row in zip(sizes, known, strict=True)]
    within = [sum(ratio <= count for ratio in ratios) for count in (1, 2)]
    return (
        f"The course is known for {len(known)} scenes without random numbers, with strains up to "
        f"{max(row.strain for row in known):.2f}: its median is {median(sizes):.3f} and its maximum {max(sizes):.2f}. "
        f"Of these, {within[0]} are within one and {within[1]} within two of these standard deviations."
    )


def cells(row: Any) -> list[str]:
    """Format the results of one scene as table cells, in the order of `HEADINGS`."""
    ratios = [row.deviation(figure, target) for figure in SHOWN for target in TARGETS]
    ratios += [row.weakness(figure, "default") for figure in SHOWN]
    costs = (
        (row.course, 3),
        (row.strain, 3),
        (row.fine, 2),
        (row.seconds + row.true_seconds, 0),
        (row.true_seconds, 0),
    )
    return [
        row.case,
        *("-" if math.isnan(ratio) else f"{ratio:.2f}" for ratio in ratios),
        *("-" if math.isnan(number) else f"{number:.{digits}f}" for number, digits in costs),
        row.remark or "-",
    ]


def before_the_rule(rows: Sequence[Any]) -> str:
    """A sentence that lists the scenes whose reference values were computed on larger elements than the present rule
    requires; empty if there are none."""
    largest = {case.name: case.largest_fine for case in figure_cases()}
    numbers = [row.case[:2] for row in rows if row.case in largest and row.fine > largest[row.case] + 1e-9]
    return f" Rows from before it, on larger elements: {', '.join(numbers)}." if numbers else ""


def write_page(rows: Sequence[Any], file: Path, command: str) -> None:
    """Write rows as a page that explains its columns.

    Parameters
    ----------
    rows : sequence of FigureRow
        The measured rows.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its origin.
    """
    text = _PAGE.format(
        command=command,
        every=len(figure_cases()),
        measured=len(rows),
        loads=LOADS,
        seed=SEED,
        fine=FINE,
        fine_rim=FINE_RIM,
        older=before_the_rule(rows),
        order=ORDER,
        points=POINTS,
        factor=FACTOR,
        course=COURSE,
        by_strain=BY_STRAIN,
        difference=DIFFERENCE,
        courses=courses(rows),
        summary=summary(rows),
        counts=markdown_table(COUNTS, counts(rows), COUNTS[:2]),
        table=markdown_table(HEADINGS, map(cells, rows), ("scene", "remark")),
    )
    write_text(file, text)
