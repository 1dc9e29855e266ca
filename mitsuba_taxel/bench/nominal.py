"""The paper's nominal study, from nothing: four shapes under normal and tangential force, and what its slopes cost."""

from __future__ import annotations

import resource
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.atomic import write_text
from mitsuba_taxel.base.markdown import markdown_table
from mitsuba_taxel.bench.isolated_process import measure_isolated
from mitsuba_taxel.pads import CELL_SHAPES
from mitsuba_taxel.reproduce import paper

TARGET_ERROR, TARGET_SLOPE = 0.005, 0.02
PATHS = ("fz", "fx")
MOST_SECONDS, MOST_MEMORY = 7200.0, 2**40
"""For one shape; solvers reserve several times as many bytes as they use, which is what a limit would count."""

HEADINGS = (
    "cell", "along", "forces", "elements [mm]", "readings within", "slopes within", "steepest [µW/N]", "CPU s"
)  # fmt: skip

_PAGE = """\
# The nominal study

Written by `{command}`; do not edit by hand.

Nine taxels of `pad.xml`, for each shape under normal force to -20 N and under tangential force along x at -8 N to
where the paper's solver ended: readings wanted within {error:g}, slopes within {slope:g} of the steepest one. Each
shape is measured in a process of its own with an empty cache of solutions.

{table}

- **forces**: steps of the force that its curves needed.
- **readings within**, **slopes within**: worst total error of nine taxels, one standard deviation; of slopes relative
  to the steepest taxel at the same force.
- **CPU s**: of all processors, with the search for mesh, steps and points in the normal one; the tangential study takes
  over mesh and points. Kernels that Dr.Jit has compiled before are not compiled again.
"""


@dataclass(frozen=True)
class NominalRow:
    """One shape; lists are by `PATHS`. ``failure`` says why there is no more."""

    cell: str
    forces: list[int]
    mesh_size: float | None
    error: list[float]
    slope: list[float]
    steepest: list[float]
    seconds: list[float]
    failure: str = ""


@dataclass(frozen=True)
class NominalShape:
    """The studies of one shape."""

    cell: str

    def measured(self) -> NominalRow:
        from mitsuba_taxel.reproduce.loading import settings_of
        from mitsuba_taxel.studies import sweep

        row = self.failed("")
        targets: dict[str, Any] = {"target_error": TARGET_ERROR, "target_slope": TARGET_SLOPE}
        ranges = f"0:{-paper.NORMAL_FORCE}", f"0:{paper.TANGENTIAL_LIMIT[self.cell]}"
        for force, reached, defines in zip(PATHS, ranges, ({}, {"fz": -paper.CONSTANT_NORMAL_FORCE}), strict=True):
            start = _processor_seconds()
            study = sweep("pad.xml", {force: reached}, {"cell": self.cell, **defines}, **targets)
            row.seconds.append(_processor_seconds() - start)
            slopes, errors = (study[name].sel(parameter=force).values for name in ("derivative", "derivative_error"))
            steepest = np.abs(slopes).max(axis=-1)
            row.forces.append(study.sizes[force])
            row.error.append(float((study.total_error / study.power).max()))
            row.slope.append(float((errors.max(axis=-1) / steepest).max()))
            row.steepest.append(float(steepest.max()))
            targets = settings_of(study)
        return NominalRow(**{**vars(row), "mesh_size": targets["mesh_size"]})

    def failed(self, end: str) -> NominalRow:
        return NominalRow(self.cell, [], float("nan"), [], [], [], [], end)


def nominal(only: str | None = None, starting: Callable[[str], None] | None = None) -> Iterator[NominalRow]:
    """Rows of the table as they are measured; ``starting`` is called with the name of each shape."""
    for cell in CELL_SHAPES:
        if only is None or fnmatchcase(cell, only):
            if starting:
                starting(cell)
            yield measure_isolated(NominalShape(cell), MOST_SECONDS, MOST_MEMORY)


def _processor_seconds() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def nominal_cells(row: NominalRow) -> list[list[str]]:
    """The row as lines of text, below `HEADINGS`."""
    if row.failure:
        return [[row.cell, row.failure, *[""] * (len(HEADINGS) - 2)]]
    elements = "default" if row.mesh_size is None else f"{row.mesh_size:.2g}"
    lines = []
    for k, force in enumerate(PATHS):
        shares = f"{row.error[k]:.2%}", f"{row.slope[k]:.2%}"
        figures = f"{row.steepest[k] * 1e6:.4g}", f"{row.seconds[k]:.0f}"
        lines.append([row.cell, force, str(row.forces[k]), elements, *shares, *figures])
    return lines


def write_page(rows: Sequence[NominalRow], file: Path, command: str) -> None:
    """Write the rows as a page that says what its columns mean."""
    table = markdown_table(HEADINGS, [line for row in rows for line in nominal_cells(row)])
    write_text(file, _PAGE.format(command=command, table=table, error=TARGET_ERROR, slope=TARGET_SLOPE))
