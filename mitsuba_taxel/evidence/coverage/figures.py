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
"""Figures of merit in the table of scenes."""
HEADINGS = ("scene", *(f"{figure}, {NAMES[t]}" for figure in SHOWN for t in TARGETS),
            *(f"reference / stated, {figure}" for figure in SHOWN),
            "course", "strain", "reference [mm]", "CPU s", "reference CPU s", "remark")  # fmt: skip
COUNTS = ("figure", "target", "figures", "not judged", "within once", "within twice", "stated / true, median", "worst")

DIFFERENCE = math.sqrt(2 * (1 - math.exp(-1 / 2)))
"""Standard deviation of the change of a course (a random function of the load) from zero load to the largest load, if
the course has a standard deviation of 1."""

_PAGE = """\
# Figures of merit of scenes drawn at random

For users of slopes, nonlinearity and hysteresis who ask how well their stated errors hold.

**{summary}**

Written by `{command}`; do not edit by hand.

The page compares figures of merit of random scenes with reference values from much smaller finite elements. Each
comparison is a **deviation**: the figure minus its reference value, divided by the combined error of both. If stated
errors hold, about 95 % of the deviations are at most 2.

## Results

{measured} of {every} scenes have been measured so far; the command continues with the others.

The table has one row for each figure of merit and each target error of the sweep:

{counts}

- **figures**: number of scenes with this figure of merit.
- **not judged**: number of figures whose reference value is too uncertain for a comparison (see below). All other
  columns exclude them.
- **within once**, **within twice**: number of deviations of at most 1 and at most 2.
- **stated / true, median**: combined error divided by the true error. Above 1, the stated errors are cautious.
- **worst**: largest deviation.

Three remarks help to read the counts:

- The four slopes of a scene are nearly the same number.
- If the default settings already meet a target error, the same sweep is used for it, and its figures are counted again.
- The model for the errors of nonlinearities was chosen with scenes 01 to 14 and 41. All other scenes were measured
  afterwards, so they test the model.

## Scenes of the test

Each scene is a pad of one or two cells. Shape, dimensions, walls, LED, material and loads are drawn at random (seed
{seed}). Of ten scenes:

- about seven have a normal force,
- one has a tangential force,
- one has a rough mirror as roof, which needs random paths,
- one is of viscoelastic silicone that is loaded and unloaded.

Each scene is swept over {loads} loads three times: at the default settings, and to target errors of 0.2 % and 0.1 %.
The figures of merit and their stated errors are those of `taxel characterise` for the first taxel.

Five scenes were added on purpose. In scene 41, the readings on elements of the default size and of twice this size
differ by only a third of the error. Scenes 42 to 45 repeat four other scenes with {factor} times their loads.

The ranges of the draw were changed once, after the first results, so that a scene takes a minute instead of ten: only a
fifth of the scenes have reflecting sides. The ranges are fixed since then; a test compares the names of all scenes.

## Reference values

A reference value is the figure of merit of readings that are extrapolated to elements of size 0. The extrapolation
uses two meshes. The finer one has elements of {fine:g} mm or less, and at most 1/1.41 of the size in the sweep to
0.1 %; the elements of the other are 1.41 times as large. The error is assumed to fall with the power {order:g} of the
element size.

**Smaller elements for one kind of scene.** Spherical cells with an isotropic roof need elements of {fine_rim:g} mm or
less. Such a roof bends into the cell along its rim, where points of the roof do not see each other; larger elements do
not resolve this strip. In scene 03, the reference value of the nonlinearity was 0.229 % from elements of 0.42 and
0.3 mm, and is 0.281 % from elements of 0.15 and 0.11 mm; the sweep states 0.278 ± 0.022 %. This rule was introduced
after such scenes had failed with elements of 0.6 mm.{older}

**Same method, same light.** If a sweep has derivatives, its largest slope and its slope at zero are compared with those
of the polynomial through all reference readings. Otherwise slopes are computed as in the sweep. The light of the
reference readings has the same patches as in the sweeps, or {points} random paths for each randomisation with another
seed. The error due to the patches is therefore not part of the comparison.

**Error of a reference value.** It has three parts:

- half of the change by the extrapolation, because the order of convergence may be 1 or 2;
- at least 0.2 % of a slope, because two meshes may agree by chance;
- the noise of random paths.

A figure is **not judged** if the error of its reference value exceeds the stated error and the deviation is at most 2:
such a comparison says little about the stated error.

## Change of the error along a load path

Elements that are too coarse change all readings of a load path by nearly the same fraction. Such an error hardly
affects the nonlinearity. What matters is how much the fraction changes along the path. The **course** measures this
change: the ratio of true to stated error of a reading at the largest load, minus this ratio at the first load.

Figures of merit treat the course as random ([theory](theory/errors.md#figures-derived-from-readings)). Its standard
deviation is {course:g} of the stated error, or {by_strain:g} times the largest strain if this is larger. Between the
first load and the last, the standard deviation of the change is {difference:.2f} times this number.

{courses}

## Scenes

The table has one row for each scene. It lists the deviations of two figures of merit at the three target errors:

{table}

- **reference / stated**: error of the reference value divided by the stated error, at the default settings. Above 1,
  the figure may not be judged.
- **course**, **strain**: course as defined above, and largest strain.
- **reference [mm]**: size of the finest elements of the reference value.
- **CPU s**, **reference CPU s**: CPU time of all processors, in total and for the reference value.
"""


def figures(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[Any]:
    """Measure the figures of merit of each random scene in a separate process, and yield its row of the table.

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
    """True errors of a figure of merit, such as a slope, at one target error, each divided by the combined standard
    error of sweep and reference value.

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
    """Change of the error of a reading along a load path, as figures of merit assume it: standard deviation of the
    change from the first load to the last, relative to the stated error.
    """
    return DIFFERENCE * min(max(COURSE, BY_STRAIN * strain), 1.0)


def courses(rows: Sequence[Any]) -> str:
    """Compare, in sentences, the change of the true error along the load path with the assumed change."""
    known = [row for row in rows if not math.isnan(row.course)]
    if not known:
        return "The course is not known for any of these scenes."
    sizes = [abs(row.course) for row in known]
    ratios = [size / taken_course(row.strain) for size, row in zip(sizes, known, strict=True)]
    within = [sum(ratio <= count for ratio in ratios) for count in (1, 2)]
    return (
        f"The course is known for {len(known)} scenes without random numbers, with strains up to "
        f"{max(row.strain for row in known):.2f}. Its median magnitude is {median(sizes):.3f}, and its largest "
        f"{max(sizes):.2f}. {within[0]} of {len(known)} courses are within one of these standard deviations, and "
        f"{within[1]} within two."
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
    """A sentence for the page that lists scenes measured earlier, whose reference values were computed on larger
    elements than is required now; empty if there are none."""
    largest = {case.name: case.largest_fine for case in figure_cases()}
    numbers = [row.case[:2] for row in rows if row.case in largest and row.fine > largest[row.case] + 1e-9]
    return f" Scenes measured before this rule, on larger elements: {', '.join(numbers)}." if numbers else ""


def write_page(rows: Sequence[Any], file: Path, command: str) -> None:
    """Write rows as a page that explains its columns.

    Parameters
    ----------
    rows : sequence of FigureRow
        The measured rows.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
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
