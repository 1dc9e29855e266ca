"""Table and page of `taxel bench light`: readings without random numbers are compared with readings by random paths,
for optical configurations drawn at random."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from statistics import median

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.coverage.light_cases import DERIVED, TIGHT, LightCase, light_cases
from mitsuba_taxel.evidence.coverage.light_row import LightRow
from mitsuba_taxel.evidence.rows.isolated_process import measure_isolated
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.evidence.rows.row_files import ResumedTable, not_measured

ALLOWED, TWICE = 3.0, 2.0
"""Largest allowed deviation of all readings, and of 95 % of the readings, in combined errors."""
SECONDS, MEGABYTES = 30.0, 3000.0
"""CPU time in s and memory in MB above which a reading counts as expensive."""

_PAGE = """\
# Light of random configurations

For users who ask whether light without random numbers is right for their optics.

**{summary}**

Written by `{command}`; do not edit by hand.

Each reading is computed twice: at the default settings, and by random paths only. Random paths use neither the patches
nor the quadrature of light without random numbers, so they are an independent check.

## Configurations

The table has one row for each configuration: a pad with one cell, unloaded or loaded. All registered cell shapes occur.
All other properties are drawn at random:

- the emission law of the LED: cones of 0.05 to 90 degrees, powers of the cosine up to a million, and tables;
- the response of the phototransistor;
- the walls, the sizes of the cell, and the dies.

{table}

- **random paths**: "yes" if the reading at the default settings uses random paths; if "no", it has no noise.
- **deviation**: relative difference of the default reading from the reading by random paths.
- **stated**: relative stated error of the default reading.
- **noise**: relative error of the reading by random paths, due to noise and triangles.
- **combined errors**: the deviation divided by the combined error of both readings (the root of the sum of squares).
- **slope deviation**, **slope stated**, **slope noise**: the same three numbers for the derivative of the reading with
  respect to {derived}, relative to the reading, per mm. Of both derivatives, the worse one is shown.
- **CPU s**, **CPU s to {tight:.1%}**: CPU time of all processors, with compilation, at the default settings and to a
  target error of {tight:.1%}.
- **MB**: peak memory.
- **measured**: date and time in UTC. Each row was measured with the code of that time (see `git log`). To measure a row
  again, delete it from the CSV file.

{missing}

## Cells with mirrors
No wall in the table is a mirror: light in cells with mirrors is always computed by random paths. Four tests show what
to expect of such readings.

**Plane mirrors are fast.** Below a plane mirror, such as the roof of an unloaded box, paths connect scattering walls
with the mirror image of the phototransistor. The test is a box at rest with a mirror roof (reflectance 0.9) and
Lambertian sides (0.9). With `taxel render FILE.xml --points 1024`, the stated error is 0.34 %. With
`--target-error 0.1%`, the reading takes 4 CPU s.

**Bent mirrors take minutes.** A load bends the mirror roof of the same box. Rays from the phototransistor are then
reflected by the mirror, and connected with the wall that they hit. If light reaches this wall by a mirror, too, the
connection does not find it, and it hits the phototransistor by chance only. The error is 1.2 % with 1024 points. It
falls as the square root of the number of paths: an error of 0.1 % needs about 120 000 points per taxel and
randomisation.

**Stated errors hold.** If few paths carry much of the light, the scatter of the replicates can understate the error.
The test uses the scene `images 5 cylindrical` of [estimators of random paths](estimators.md), with 32 768 points and 8
seeds. The reference is the mean of many more paths. The table has one row for each state of the roof; *before* means
before rays were reflected by mirrors:

| roof | mean square of deviation / stated error | largest deviation | before: mean square | before: largest deviation |
| :-- | --: | --: | --: | --: |
| at rest, without connections over its mirror image | 2.8 | 0.33 % | 240 | 13 % |
| pressed by 0.3 N | 0.2 | 0.13 % | 179 | 10 % |

Reflecting these rays takes 3 to 27 % of the time. `pytest tests/kernels/test_reflected_views.py -k narrow` repeats the
test with fewer paths on a similar scene.

**Small phototransistors are noisy.** The test has an LED below a bent mirror roof, and a phototransistor of 0.05 mm
beside Lambertian sides (0.9): nearly all light arrives by chance. For the response cosine_power with exponents of 8 and
2, 40 seeds of 4096 points state a median error of 3.5 to 5.8 %. The mean square of deviation / stated error is 2.2 to
2.6, and 82 % of the readings are within twice the stated error.

A reading has a [note](howto/convergence.md#few-light-paths-carry-much-of-the-light) if one randomisation causes more
than half of the scatter. With 1024 points and an exponent of 2, this happened for 4 of 8 seeds.
"""


def light(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[LightRow]:
    """Measure each case of the table in a separate process, and yield its row.

    Parameters
    ----------
    only, csv_file, markdown, starting
        See `ResumedTable.rows`.

    Returns
    -------
    Iterator[LightRow]
        Rows in the order of the table.
    """
    table = ResumedTable("light", light_cases(), LightRow, _measured, write_page)
    return table.rows(only, csv_file, markdown, starting)


def _measured(case: LightCase) -> LightRow:
    row = measure_isolated(case)
    return replace(row, measured=f"{datetime.now(timezone.utc):%Y-%m-%d %H:%M}")


def summary(rows: Sequence[LightRow]) -> str:
    """Summarise rows: the numbers of readings within their errors, and the computing times."""
    read = [row for row in rows if not row.remark]
    if not read:
        return f"None of {len(rows)} configurations could be read."
    noiseless = [row for row in read if row.random == "no"]
    resolved = [row.stated / abs(row.off) for row in noiseless if row.off and row.noise < row.stated]
    slopes = [row for row in read if row.slope_deviates == row.slope_deviates]
    expensive = sum(max(row.seconds, row.tight_seconds) > SECONDS or row.megabytes > MEGABYTES for row in read)
    sentences = [
        f"{sum(row.deviates <= ALLOWED for row in read)} of {len(read)} readings agree within {ALLOWED:g} combined "
        f"errors, {sum(row.deviates <= TWICE for row in read)} within {TWICE:g}; {len(noiseless)} need no random paths",
    ]
    if resolved:
        sentences.append(f"their stated error is {median(resolved):.1f} times the deviation in the median")
    sentences.append(
        f"{sum(row.slope_deviates <= ALLOWED for row in slopes)} of {len(slopes)} slopes agree within {ALLOWED:g}"
    )
    sentences.append(f"{expensive} readings take more than {SECONDS:g} CPU s or {MEGABYTES / 1000:g} GB")
    if len(read) < len(rows):
        sentences.append(f"{len(rows) - len(read)} configurations could not be read")
    return "; ".join(sentences) + "."


def write_page(rows: Sequence[LightRow], file: Path, command: str) -> None:
    """Write the rows as a page that explains its columns.

    Parameters
    ----------
    rows : sequence of LightRow
        The measured rows.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
    """
    words = "configuration", "random paths", "measured", "remark"
    text = _PAGE.format(
        command=command,
        summary=summary(rows),
        table=markdown_table(headings(LightRow), map(cells, rows), words),
        derived=" or ".join(f"`{name}`" for name in DERIVED),
        tight=TIGHT,
        missing=not_measured(light_cases(), rows),
    )
    write_text(file, text)
