"""Table of `taxel bench rough`: slopes of the readings of cells with rough walls, their errors and their CPU time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.evidence.domes.domes import dome_scene
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.reading.runs import Run, prepare
from mitsuba_taxel.studies import sweep
from mitsuba_taxel.studies.store.slope_target import curve_errors

LOADS = (0.0, -0.1216, -0.415, -0.7084, -0.83)
"""Chebyshev points from rest to -0.83 N, which is 10 N on a pad of 12 cells."""
STEPS = {"finish": "layer_steps", "layer_height": 0.1}
MIRROR = {"scattering": "rough_mirror", "rms_slope": 5.0}
LAMBERTIAN = {"scattering": "lambertian", "reflectance": 0.9}


@dataclass(frozen=True)
class RoughCase:
    """Square pad whose walls are rough, and the number of light paths for its study.

    Attributes
    ----------
    cell : str
        Shape of the cells.
    roof : dict
        Parameters of the `wall` of the roof.
    points : int
        Number of light paths per taxel and replicate.
    pad : dict
        Other parameters of the pad, such as its finish.
    side : int
        Number of cells along each side of the pad. The force is proportional to the number of cells.
    """

    cell: str
    roof: dict[str, Any]
    points: int
    pad: dict[str, Any] = field(default_factory=dict)
    side: int = 1


CASES: dict[str, RoughCase] = {
    "spherical, steps of 0.1 mm": RoughCase("spherical", LAMBERTIAN, 18432, STEPS),
    "spherical, steps of 0.1 mm, 3 x 3": RoughCase("spherical", LAMBERTIAN, 18432, STEPS, side=3),
    "hemispheric, steps of 0.1 mm": RoughCase("hemispheric", LAMBERTIAN, 28672, STEPS),
    "spherical, rough mirror of 5 degrees": RoughCase("spherical", MIRROR, 4096),
    "parallelepiped, rough mirror of 5 degrees": RoughCase("parallelepiped", MIRROR, 4096, {"mesh_size": 0.6}),
}
"""Cases by name."""


@dataclass(frozen=True)
class RoughRow:
    """Slope of a reading over the force in a pad with rough walls, and its relative errors, of the worst taxel.

    Attributes
    ----------
    case : str
        Name of the case in `CASES`.
    points : int
        Number of light paths per taxel and replicate.
    reading : float
        Relative error of the worst reading due to light.
    slope, light, shape : float
        Mean slope in µW/N; its relative error due to the light; and that due to finite elements and facets.
    largest : float
        Relative error of the largest slope due to the light and to the fitted curve.
    seconds : float
        CPU seconds of the study.
    plain : float
        Relative error of the mean slope by the same number of plain paths, which share their random numbers between
        loads.
    """

    COLUMNS: ClassVar = {
        "case": ("cell", ""),
        "points": ("points", ""),
        "reading": ("reading", ".2%"),
        "slope": ("slope [µW/N]", ".1f"),
        "light": ("light", ".2%"),
        "shape": ("shape", ".2%"),
        "largest": ("largest slope", ".2%"),
        "seconds": ("CPU s", ".0f"),
        "plain": ("shared numbers", ".1%"),
    }
    case: str
    points: int
    reading: float
    slope: float
    light: float
    shape: float
    largest: float
    seconds: float
    plain: float


_PAGE = """\
# Slopes with rough walls

For users whose cells have a finish or rough mirrors, and who ask what a slope costs there.

In {most:.0f} CPU seconds, one cell has its mean slope to {worst:.1%} at worst, by light and elements together.

Written by `{command}`; do not edit by hand.

Each row is a study of one cell, or of 3 x 3 cells, over five loads from 0 to -0.83 N per cell. Elements have the
default size; those of the parallelepiped 0.6 mm. The LED emits 1 W, all walls except the roof absorb, and Lambertian
roofs reflect 90 %. *Steps of 0.1 mm* are the layers of a printed mould on roof and side; a *rough mirror of 5 degrees*
is a roof whose normals scatter by 5 degrees (root mean square). All errors are relative, and those of the worst taxel.

{table}

- **points**: number of light paths in each of 32 randomisations. **reading**: error of the worst reading due to the
  light.
- **slope**: mean slope over the force. **light**, **shape**: error of the mean slope due to the light, and due to
  finite elements and facets.
- **largest slope**: error of the largest slope due to the light and the [curve](theory/derivatives.md) between loads.
- **CPU s**: CPU time of the study, with the mechanics and all errors.
- **shared numbers**: for comparison, the error due to the light of a slope that is the difference of two readings with
  the same random numbers and as many paths. Cells with a finish use [paths through material
  points](theory/derivatives.md#paths-through-material-points) instead, whose error is in the column *light*.
"""


def rough_slopes(starting: Callable[[str], None] | None = None) -> Iterator[RoughRow]:
    """Measure slopes of cells with rough walls, and yield a row for each case; ``starting`` is called with the name of
    a case before it is measured.
    """
    for name, case in CASES.items():
        if starting:
            starting(name)
        yield _row(name, case)


def _row(name: str, case: RoughCase) -> RoughRow:
    def scene(load: float) -> Scene:
        return dome_scene(case.cell, case.roof, case.side, force=[0.0, 0.0, load], **case.pad)

    loads = [case.side**2 * load for load in LOADS]
    start = time.process_time()
    study = sweep(scene(loads[-1]), {"fz": loads}, points=case.points, derivatives=["fz"])
    seconds = time.process_time() - start
    mean, largest = curve_errors(study)
    reading = float((study.standard_error / study.power).max())
    worst = int(np.argmax(np.hypot(mean.relative[0], mean.relative[2])))
    slope = float(mean.value[worst])
    ends = []
    for load in (loads[0], loads[-1]):
        run = Run(prepare(scene(load)), 0)
        run.extend_to(case.points)
        ends.append(run.powers[:, worst])
    plain = float(standard_error(ends[1] - ends[0])) / abs(loads[-1] * slope)
    light, _, shape = map(float, mean.relative[:, worst])
    of_largest = float(np.hypot(*largest.relative[:2]).max())
    return RoughRow(
        case=name,
        points=case.points,
        reading=reading,
        slope=1e6 * slope,
        light=light,
        shape=shape,
        largest=of_largest,
        seconds=seconds,
        plain=plain,
    )


def write_page(rows: Sequence[RoughRow], file: Path, command: str) -> None:
    """Write rows as a page that explains its columns.

    Parameters
    ----------
    rows : sequence of RoughRow
        All rows.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
    """
    table = markdown_table(headings(RoughRow), map(cells, rows), headings(RoughRow)[:1])
    single = [row for row in rows if row.case not in CASES or CASES[row.case].side == 1]
    most, worst = max(row.seconds for row in single), max(math.hypot(row.light, row.shape) for row in single)
    write_text(file, _PAGE.format(command=command, table=table, most=most, worst=worst))
