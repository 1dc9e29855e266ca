"""Rows as files: CSV with all digits, and a page of Markdown."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

from mitsuba_taxel.base.atomic import replacing
from mitsuba_taxel.base.markdown import markdown_table
from mitsuba_taxel.bench.cases import MESH_SIZE
from mitsuba_taxel.bench.isolated_process import MOST_MEMORY, MOST_SECONDS
from mitsuba_taxel.bench.reading_row import MOST_DEVIATIONS, READING_HEADINGS, ReadingRow, reading_cells
from mitsuba_taxel.bench.row import HEADINGS, Row, cells
from mitsuba_taxel.mechanics import NeoHookean

LEFT = ("case", "setting", "verdict", "stability", "reference by", "remark")
"""Headings of columns of words."""

_PAGE = """\
# At the extremes

Written by `{command}`; do not edit by hand. A process that crashed or went beyond {seconds:g} s or {memory:g} GB says
so. `WRONG` marks what must not be, and the command then exits with 1.
"""

_MECHANICS = """
## Mechanics
Where nothing else is said, a pad is that of the paper
(3 x 3 parallelepiped cells, {silicone}) on elements of {mesh_size:g} mm, which is coarse: the table is
about what happens, not about the last digit. Forces are in N, compression is z < 0. The rigid plate stands for a stiff
layer bonded on top, whose limit it is. For comparison: the paper's solver stopped at tangential forces of 11 N
(parallelepiped), 13 N (cylindrical), 8 N (spherical) and 13 N (hemispheric) at -8 N.

{table}

- **verdict**: `converged`; `ends at` a load and why: the pad touches something there, or no stable state was found
  beyond it; `refused` where one Newton solve, which looks for no contact, was asked for and found no acceptable state.
  `WRONG` is a step accepted with an inverted element, a number that is none, forces out of balance, a stated error less
  than half of what the finer mesh shows.
- **Newton**, **steps**, **cutbacks**: iterations over all accepted steps; accepted steps; how often a step was halved,
  for want of an acceptable state or for the accuracy between steps, or given up.
- **min J**, **min J at nodes**: least volume ratio at quadrature points and at the ten nodes of the elements, at any
  step (the last one may lie beyond the load); and at the nodes in the last state, computed anew. The last state is that
  of the whole load, or just before the end.
- **residual**, **imbalance**: largest out-of-balance force at the steps, relative to the load; and how far the board's
  reaction and the load are from balance in the last state, interpolated between steps, by forces assembled anew.
- **stability**: `stable` where the factored tangent had as many negative pivots as it should at every step, on each
  block that the pad's symmetry leaves; `not checked` where the solver does not count them.
- **mean roof**: length of the roofs' mean displacement. **stated error**: what the state itself states, root mean
  square over the roofs, relative to it. **finer mesh**: change of the mean displacement on elements smaller by 1.5.
- **CPU s**, **MB**: time of all processors for the state with its error, and most memory of the process.
"""


_READINGS = """
## Readings
Each case is read as a user would read it, and compared with what it should be: rays that `analog_tracer` released and
counted, or a law of scale. Some must be refused.

{table}

- **verdict**: `right` within {deviations:g} errors of both; `refused` with the message. `WRONG` is another reading, one
  that should have been refused, or a refusal of what should be read.
- **power**, **error**: of the taxel that is worst, and its standard error, relative. **deviations**: of the errors of
  both, from the reference.
- **CPU s**, **MB**: time of all processors for both, and most memory of the process.
"""


def write_csv(rows: Sequence[Row | ReadingRow], file: Path) -> None:
    """Write the rows with a heading, all digits; a column that a row has not is empty, no number is ``nan``."""
    names = dict.fromkeys(field.name for kind in (Row, ReadingRow) for field in fields(kind))
    with replacing(file) as temporary, temporary.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(names))
        writer.writeheader()
        writer.writerows(map(asdict, rows))


def write_markdown(rows: Sequence[Row | ReadingRow], file: Path, command: str) -> None:
    """Write the rows as a page that says which ``command`` wrote it, and what its columns mean."""
    mechanics = [row for row in rows if isinstance(row, Row)]
    readings = [row for row in rows if isinstance(row, ReadingRow)]
    text = _PAGE.format(command=command, seconds=MOST_SECONDS, memory=MOST_MEMORY / 2**30)
    if mechanics:
        table = markdown_table([*HEADINGS.values()], map(cells, mechanics), LEFT)
        law = NeoHookean()
        silicone = f"E = {law.youngs_modulus:g} MPa, nu = {law.poisson_ratio:g}"
        text += _MECHANICS.format(silicone=silicone, mesh_size=MESH_SIZE, table=table)
    if readings:
        table = markdown_table([*READING_HEADINGS.values()], map(reading_cells, readings), LEFT)
        text += _READINGS.format(deviations=MOST_DEVIATIONS, table=table)
    with replacing(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
