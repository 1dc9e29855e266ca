"""Cost of the paper's nominal study, computed without caches: four cell shapes under normal and tangential force."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.base.processes.system import processor_seconds
from mitsuba_taxel.evidence.paper.loading import TARGET_ERROR, TARGET_SLOPE
from mitsuba_taxel.evidence.rows.isolated_process import measure_isolated
from mitsuba_taxel.pads import CELL_SHAPES

PATHS = ("fz", "fx")
MOST_SECONDS, MOST_MEMORY = 7200.0, 2**40
"""Limits of one shape, in s and bytes; the memory is practically unlimited, as solvers reserve more than they use."""

HEADINGS = (
    "cell", "along", "forces", "elements [mm]", "readings within", "slopes within", "steepest [µW/N]", "CPU s"
)  # fmt: skip

_PAGE = """\
# The nominal study

For users who ask how long a study takes and how exact it is.

Written by `{command}`; do not edit by hand.

For each cell shape, two studies compute readings of the nine taxels of `pad.xml`: under normal forces up to -20 N, and
under tangential forces along x at a normal force of -8 N, up to the force at which the paper's solver stopped. Target
errors are {error:g} of a reading, and {slope:g} of the steepest slope. Each shape is measured in a separate process
with an empty cache of solutions.

{table}

- **forces**: number of forces that the curves needed.
- **readings within**, **slopes within**: largest total error of nine taxels, one standard deviation; for slopes
  relative to the steepest taxel at the same force.
- **CPU s**: CPU time of all processors. The study under normal forces includes the search for mesh, steps and points.
  The study under tangential forces reuses points and mesh, and searches for a finer mesh only if its slopes miss the
  target. Kernels that Dr.Jit has compiled before are not compiled again.
"""


@dataclass(frozen=True)
class NominalRow:
    """Result of the studies of one cell shape; lists have an entry for each load path in `PATHS`. ``failure`` gives the
    reason if the process failed.
    """

    cell: str
    forces: list[int]
    mesh_size: list[float | None]
    error: list[float]
    slope: list[float]
    steepest: list[float]
    seconds: list[float]
    failure: str = ""


@dataclass(frozen=True)
class NominalShape:
    """The paper's nominal studies of one cell shape, as a case that is measured in a separate process."""

    cell: str

    def measured(self) -> NominalRow:
        from mitsuba_taxel.evidence.paper import loading
        from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
        from mitsuba_taxel.evidence.paper.slopes import slope_share

        row = self.failed("")
        with TemporaryDirectory() as folder:
            store = PaperStudies(Path(folder), announce=lambda name: None)
            for force, studied in (("fz", loading.normal), ("fx", loading.along_x)):
                start = processor_seconds()
                study = studied(store, self.cell)
                row.seconds.append(processor_seconds() - start)
                row.forces.append(study.sizes[force])
                row.mesh_size.append(loading.settings_of(study)["mesh_size"])
                row.error.append(float((study.total_error / study.power).max()))
                row.slope.append(slope_share(study))
                row.steepest.append(float(np.abs(study.derivative).max()))
        return row

    def failed(self, end: str) -> NominalRow:
        return NominalRow(self.cell, [], [], [], [], [], [], end)


def nominal(only: str | None = None, starting: Callable[[str], None] | None = None) -> Iterator[NominalRow]:
    """Measure the studies of each cell shape, and yield a row for each.

    Parameters
    ----------
    only : str, optional
        Pattern of the shapes' names, with the wildcards * and ?.
    starting : Callable[[str], None], optional
        Called with the name of each shape.
    """
    for cell in CELL_SHAPES:
        if only is None or fnmatchcase(cell, only):
            if starting:
                starting(cell)
            yield measure_isolated(NominalShape(cell), MOST_SECONDS, MOST_MEMORY)


def nominal_cells(rows: Sequence[NominalRow]) -> list[list[str]]:
    """Format rows as lines of table cells, in the order of `HEADINGS`."""
    return [line for row in rows for line in _lines(row)]


def _lines(row: NominalRow) -> list[list[str]]:
    if row.failure:
        return [[row.cell, row.failure, *[""] * (len(HEADINGS) - 2)]]
    lines = []
    for k, force in enumerate(PATHS):
        size = row.mesh_size[k]
        elements = "default" if size is None else f"{size:.2g}"
        shares = f"{row.error[k]:.2%}", f"{row.slope[k]:.2%}"
        figures = f"{row.steepest[k] * 1e6:.4g}", f"{row.seconds[k]:.0f}"
        lines.append([row.cell, force, str(row.forces[k]), elements, *shares, *figures])
    return lines


def write_page(rows: Sequence[NominalRow], file: Path, command: str) -> None:
    """Write the rows as a Markdown page that explains its columns.

    Parameters
    ----------
    rows : sequence of NominalRow
        The rows.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
    """
    table = markdown_table(HEADINGS, nominal_cells(rows))
    write_text(file, _PAGE.format(command=command, table=table, error=TARGET_ERROR, slope=TARGET_SLOPE))
