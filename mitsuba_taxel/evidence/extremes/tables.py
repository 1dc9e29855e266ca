"""Rows of extreme cases as a CSV file and as a page of Markdown."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.extremes.case import MESH_SIZE
from mitsuba_taxel.evidence.extremes.circuit_cases import MOST_DIFFERENCE
from mitsuba_taxel.evidence.extremes.circuit_row import CircuitRow
from mitsuba_taxel.evidence.extremes.reading_row import MOST_DEVIATIONS, ReadingRow
from mitsuba_taxel.evidence.rows.isolated_process import MOST_MEMORY, MOST_SECONDS
from mitsuba_taxel.evidence.rows.row import MechanicsRow, cells, headings
from mitsuba_taxel.mechanics import NeoHookean

AnyRow = MechanicsRow | ReadingRow | CircuitRow
LEFT = ("case", "setting", "verdict", "stability", "reference by", "remark")
"""Headings of text columns."""

_PAGE = """\
# Extreme cases

For users who load pads to the limit, or use extreme shapes, materials and circuits.

Each case is at the limit of what can be computed. The program must give a right result, or refuse the case with a
message. `WRONG` marks a failure; the command then exits with 1.

Written by `{command}`; do not edit by hand. Each case is measured in a separate process. Processes that crashed, or
exceeded {seconds:g} s or {memory:g} GB, are reported.
"""

_MECHANICS = """
## Mechanics
The table has one row for each pad and load. It is about robustness, not accuracy: the elements are coarse
({mesh_size:g} mm unless stated otherwise).

Unless stated otherwise, the pad is that of the paper (3 x 3 parallelepiped cells, {silicone}). Forces are in N, and
compression is z < 0. A rigid plate stands for a stiff layer bonded to the top. For comparison, the paper's solver
stopped at tangential forces of 11 N (parallelepiped), 13 N (cylindrical), 8 N (spherical) and 13 N (hemispheric) at
-8 N.

{table}

- **verdict**: one of three outcomes.
  - `converged`: the whole load was applied.
  - `ends at` a load, with the reason: the pad touches something there, or no stable state was found beyond it.
  - `refused`, with the message.

  `WRONG` marks a case that should have been refused, a wrong refusal, an accepted step with an inverted element, a NaN,
  forces out of balance, or a stated error below half of the change on the finer mesh.
- **Newton**: number of Newton iterations over all accepted load steps.
- **steps**: number of accepted load steps.
- **cutbacks**: number of load steps that were abandoned or halved, because no acceptable state was found or for
  accuracy between steps.
- **min J**: smallest volume ratio J (Jacobian) at the quadrature points and nodes of the elements, at any step. The
  last step may lie beyond the load.
- **min J at nodes**: smallest J at the nodes in the last state, computed independently of the solver. The last state is
  that under the whole load, or just before the end of the load path.
- **residual**: largest out-of-balance force of any step, relative to the load.
- **imbalance**: difference between reaction and load in the last state, which is interpolated between steps. The forces
  are assembled independently of the solver.
- **stability**: `stable` if the factored tangent matrix had the expected number of negative pivots at every step, in
  each block of the symmetric pad; `not checked` under friction.
- **mean roof**: magnitude of the roofs' mean displacement.
- **stated error**: stated error of the displacement (root mean square over the roofs), relative to **mean roof**; not
  computed with self_contact.
- **finer mesh**: relative change of the mean displacement on elements 1.5 times smaller.
- **CPU s**, **MB**: CPU time of all processors for the state with its error, and peak memory of the process.
"""


_READINGS = """
## Readings
The table has one row for each scene. Its reading is computed as a user would compute it, and compared with a reference
value: rays counted by `analog_tracer`, or a scaling law. Some scenes must be refused.

{table}

- **verdict**: `right` if the reading is within {deviations:g} combined errors of the reference; `refused`, with the
  message. `WRONG` is a wrong reading, a reading that should have been refused, or a wrong refusal.
- **power**, **error**: reading of the taxel that deviates most, and its relative standard error.
- **deviations**: deviation from the reference, divided by the combined error.
- **CPU s**, **MB**: CPU time of all processors for both, and peak memory of the process.
"""


_CIRCUITS = """
## Circuits
The table has one row for each circuit and optical power. The reference voltage is the solution of Kirchhoff's current
law at the emitter, computed with 60 decimal digits.

Unless stated otherwise, the circuit has a supply of 3.3 V, a load resistance of 10 kOhm, a transfer of 8 mA/W and 12
bits.

{table}

- **verdict**: `right` if the voltage is within {difference:g} of the reference. `WRONG` is a wrong voltage, wrong
  counts, or a noise that is NaN or below that of the converter.
- **noise**: standard deviation of the voltage.
- **CPU s**, **MB**: CPU time of all processors, and peak memory of the process.
"""


def write_csv(rows: Sequence[AnyRow], file: Path) -> None:
    """Write rows to a CSV file, with a line of headings and numbers in full precision.

    Parameters
    ----------
    rows : sequence of rows
        Rows to write. Columns that a row lacks stay empty; missing numbers are ``nan``.
    file : Path
        CSV file, which is replaced.
    """
    names = dict.fromkeys(field.name for kind in (MechanicsRow, ReadingRow, CircuitRow) for field in fields(kind))
    with replacing(file) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(names))
        writer.writeheader()
        writer.writerows(map(asdict, rows))


def write_markdown(rows: Sequence[AnyRow], file: Path, command: str, missing: str) -> None:
    """Write rows as a Markdown page that explains its columns.

    Parameters
    ----------
    rows : sequence of rows
        Rows of any of the three tables.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
    missing : str
        Last paragraph of the page, which lists the cases that are not measured.
    """
    mechanics = [row for row in rows if isinstance(row, MechanicsRow)]
    readings = [row for row in rows if isinstance(row, ReadingRow)]
    text = _PAGE.format(command=command, seconds=MOST_SECONDS, memory=MOST_MEMORY / 2**30)
    if mechanics:
        table = markdown_table(headings(MechanicsRow), map(cells, mechanics), LEFT)
        law = NeoHookean()
        silicone = f"E = {law.youngs_modulus:g} MPa, nu = {law.poisson_ratio:g}"
        text += _MECHANICS.format(silicone=silicone, mesh_size=MESH_SIZE, table=table)
    if readings:
        table = markdown_table(headings(ReadingRow), map(cells, readings), LEFT)
        text += _READINGS.format(deviations=MOST_DEVIATIONS, table=table)
    circuits = [row for row in rows if isinstance(row, CircuitRow)]
    if circuits:
        table = markdown_table(headings(CircuitRow), map(cells, circuits), LEFT)
        text += _CIRCUITS.format(difference=MOST_DIFFERENCE, table=table)
    write_text(file, f"{text}\n{missing}\n")
