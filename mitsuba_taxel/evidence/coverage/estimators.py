"""Table of `taxel bench estimators`: two variance-reduced estimators of readings by random paths are each compared with
plain paths, for scenes drawn at random.

The estimators are connections over plane mirrors (image connections), and differences of readings by paths through
material points. In each comparison, both methods have the same expected value, triangle by triangle.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.evidence.coverage.light_cases import LightCase, drawn_case
from mitsuba_taxel.evidence.rows.isolated_process import measure_isolated
from mitsuba_taxel.evidence.rows.kind_examples import generator
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.evidence.rows.row_files import ResumedTable, not_measured
from mitsuba_taxel.kernels.paths.plane_mirrors import without_images
from mitsuba_taxel.pads.cells.cell_shape import FLAT_ROOF, CellShape
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.parameters import parameters_of
from mitsuba_taxel.sensing.reading.paired import can_be_paired, paired_with
from mitsuba_taxel.sensing.reading.runs import Prepared, Run, prepare
from mitsuba_taxel.specification.deformable_pad import FINISHES

SEED = 58
IMAGES, DIFFERENCES = 5, 4
"""Numbers of scenes for each shape with a flat roof, and for each shape."""
POINTS, IMAGE_POINTS, DIFFERENCE_POINTS = 1 << 12, 1 << 18, 1 << 15
"""Numbers of points per replicate: of the estimators, and of the plain paths for readings and for differences. Plain
paths for readings need many points: rare paths carry much of the light, so that the scatter of few points understates
the error."""
ALLOWED = 4.0
"""Largest allowed deviation, in combined errors; about 1 in 16 000 scenes exceeds it by chance."""
FILLET = 0.1
"""Radius of rounded edges, mm."""
FINISH_VALUES: dict[str, dict[str, Any]] = {
    "layer_steps": {"layer_height": 0.1},
    "grooves": {"groove_pitch": 0.2, "groove_depth": 0.05},
    "random": {"rms_height": 0.01, "correlation_length": 0.2},
}
"""Parameters of the finishes, by their names in a scene."""

_PAGE = """\
# Estimators of random paths

For people who change how light is traced.

Written by `{command}`; do not edit by hand.

**{summary}**

This page tests two methods that reduce the noise of random paths. Each row is a pad with one cell, whose optics are
drawn at random as on the page [light of random configurations](light.md).

- Rows *images* compare readings with and without [connections over a mirror](theory/light.md). The mirror is the flat
  roof of an unloaded pad.
- Rows *differences* compare two estimates of the change of a reading between two loads, on the same triangles: by
  [paths through material points](theory/derivatives.md#paths-through-material-points), and as a difference of readings
  that share their random numbers. Walls are diffuse, with or without a finish, and rims are sharp or rounded.

The table follows; its columns are explained below it.

{table}

- **value**: the reading, or its change, by plain paths, without the tested method.
- **deviation**: relative deviation of the tested method from this value. **combined errors**: deviation divided by the
  combined standard error of both.
- **gain**: variance of plain paths divided by the variance of the tested method, for equal numbers of paths. It is a
  lower bound, because more plain paths are traced, and their variance falls faster than their number rises. If the LED
  has a narrow beam, paths through material points leave the beam and have more noise than plain paths; studies then use
  plain paths.
- **CPU s**: CPU time of both, with the mechanics.

{missing}
"""


@dataclass(frozen=True)
class EstimatorRow:
    """Comparison of an estimator with plain paths in one scene; missing values are NaN.

    Attributes
    ----------
    value : float
        Reading, or difference of two readings, by plain paths, in W.
    off : float
        Value of the estimator minus the value by plain paths, in W.
    error : float
        Standard error of this deviation, in W.
    gain : float
        Variance of plain paths divided by that of the estimator, for equal numbers of paths.
    seconds : float
        CPU time, in s.
    """

    COLUMNS: ClassVar = {
        "case": ("scene", ""),
        "value": ("value [W]", ".4g"),
        "relative": ("deviation", ".2%"),
        "deviates": ("combined errors", ".2f"),
        "gain": ("gain", ".3g"),
        "seconds": ("CPU s", ".0f"),
        "remark": ("remark", ""),
    }
    case: str
    remark: str = ""
    value: float = math.nan
    off: float = math.nan
    error: float = math.nan
    gain: float = math.nan
    seconds: float = math.nan

    @property
    def relative(self) -> float:
        """Deviation divided by the value."""
        return self.off / abs(self.value) if self.value else math.nan

    @property
    def deviates(self) -> float:
        """Magnitude of the deviation divided by its standard error."""
        return abs(self.off) / self.error if self.error else 0.0


@dataclass(frozen=True)
class EstimatorCase:
    """A comparison of two ways to estimate the same number by random paths: a reading with and without image
    connections (connections over a mirror image), or the difference between two loads with and without paths through
    material points.

    Attributes
    ----------
    light : LightCase
        The scene; for a difference, under the larger load.
    load : tuple[float, float, float] or None
        Smaller load of a difference, in N; None for the comparison of a reading.
    """

    light: LightCase
    load: tuple[float, float, float] | None

    @property
    def name(self) -> str:
        """Description of the case, which names its row."""
        return self.light.name

    def failed(self, end: str) -> EstimatorRow:
        """Row of a case whose process ended without a result, for the reason ``end``."""
        return EstimatorRow(self.name, end)

    def measured(self) -> EstimatorRow:
        """Compute this comparison in the present process, and return the row of the table."""
        start = time.process_time()
        try:
            with tempfile.TemporaryDirectory() as folder:
                row = self._images(Path(folder)) if self.load is None else self._differences(Path(folder))
        except (ComputationError, InputError) as error:
            row = EstimatorRow(self.name, str(error))
        return replace(row, seconds=time.process_time() - start)

    def _images(self, folder: Path) -> EstimatorRow:
        ready = prepare(self.light.scene(folder))
        with_images = _powers(ready, POINTS, 1)
        with without_images(ready.scene):
            without = _powers(ready, IMAGE_POINTS, 2)
        return self._compared(with_images, without, IMAGE_POINTS)

    def _differences(self, folder: Path) -> EstimatorRow:
        larger = self.light.scene(folder)
        pad = {**self.light.source["pad"], "force": list(self.load or ())}
        smaller = replace(self.light, source={**self.light.source, "pad": pad}).scene(folder)
        base = prepare(larger)
        if not can_be_paired(base) or (paired := paired_with(larger, base, smaller)).paired is None:
            return EstimatorRow(self.name, "no paths through material points: the states have different triangles")
        of_points = _powers(paired, POINTS, 1) - _powers(base, POINTS, 1)
        shared = _powers(prepare(smaller), DIFFERENCE_POINTS, 2) - _powers(base, DIFFERENCE_POINTS, 2)
        return self._compared(of_points, shared, DIFFERENCE_POINTS)

    def _compared(self, estimated: np.ndarray, plain: np.ndarray, plain_points: int) -> EstimatorRow:
        error, plain_error = float(standard_error(estimated)), float(standard_error(plain))
        gain = plain_points / POINTS * (plain_error / error) ** 2 if error else math.nan
        off = float(estimated.mean() - plain.mean())
        return EstimatorRow(self.name, "", float(plain.mean()), off, math.hypot(error, plain_error), gain)


def _powers(ready: Prepared, points: int, seed: int) -> np.ndarray:
    """Readings (R,) of the first taxel in R replicates, in W."""
    run = Run(ready, seed)
    run.extend_to(points)
    return run.powers[:, 0]


def estimator_cases() -> list[EstimatorCase]:
    """Draw all cases of the table at random. Each cell shape has separate random numbers."""
    cases = []
    for cell, shape in CellShape.kinds().items():
        random = generator(SEED, cell)
        images = IMAGES if shape.light_sizes is FLAT_ROOF else 0
        cases += [_with_mirror(random, f"images {number} {cell}", cell) for number in range(1, images + 1)]
        cases += [_with_loads(random, f"differences {number} {cell}", cell) for number in range(1, DIFFERENCES + 1)]
    return cases


def _with_mirror(random: np.random.Generator, label: str, cell: str) -> EstimatorCase:
    """A case of an unloaded pad whose roof is entirely or partly a mirror, and whose sides are diffuse."""
    case = drawn_case(random, label, cell)
    pad = {name: value for name, value in case.source["pad"].items() if name not in ("force", "mesh_size")}
    roof = {"type": "wall", "scattering": "mirror", "reflectance": round(random.uniform(0.3, 1.0), 2)}
    if random.random() < 0.5:
        roof |= {"scattering": "mixed", "specular": 0.5, "lambertian": 0.3, "isotropic": 0.2}
    return EstimatorCase(_with_walls(case, pad, roof, _diffuse(random), label), None)


def _with_loads(random: np.random.Generator, label: str, cell: str) -> EstimatorCase:
    """A case of a pad under two loads, with a random finish and, if its shape allows, a fillet."""
    case = drawn_case(random, label, cell)
    pad = {name: value for name, value in case.source["pad"].items() if name != "mesh_size"}
    force = [*random.uniform(-0.1, 0.1, 2).round(2).tolist(), -round(random.uniform(0.3, 0.9), 2)]
    fraction = round(random.uniform(0.2, 0.8), 2)
    finish = str(random.choice(["smooth", *FINISHES]))
    pad |= {"force": force, "finish": finish, **FINISH_VALUES.get(finish, {})}
    words = f"{label}, {force[2]:g} N and {fraction:g} of it, {finish}"
    if random.random() < 0.5 and _can_be_rounded(pad):
        pad["fillet"] = FILLET
        words += f", fillet {FILLET:g} mm"
    smaller = (fraction * force[0], fraction * force[1], fraction * force[2])
    return EstimatorCase(_with_walls(case, pad, _diffuse(random), _diffuse(random), words), smaller)


def _can_be_rounded(pad: dict[str, Any]) -> bool:
    dimensions = {name: value for name, value in pad.items() if name in parameters_of(Pad)}
    try:
        Pad(**dimensions, fillet=FILLET)
    except InputError:
        return False
    return True


def _diffuse(random: np.random.Generator) -> dict[str, Any]:
    """A random diffuse wall: Lambertian or isotropic."""
    scattering = str(random.choice(["lambertian", "isotropic"]))
    return {"type": "wall", "scattering": scattering, "reflectance": round(random.uniform(0.3, 0.95), 2)}


def _with_walls(case: LightCase, pad: dict[str, Any], roof: dict, side: dict, words: str) -> LightCase:
    """Copy a case with another pad and other walls. Its new name consists of ``words``, the walls and the optics."""
    walls = ", ".join(f"{name} {wall['scattering']} {wall['reflectance']:g}" for name, wall in
                      (("roof", roof), ("sides", side)))  # fmt: skip
    source = {**case.source, "pad": {**pad, "bsdf": {"type": "region", "roof": roof, "side": side}}}
    return replace(case, name=f"{words}, {walls}{case.name[case.name.index('; LED') :]}", source=source)


def estimators(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[EstimatorRow]:
    """Measure each case of the table in a separate process, and yield its row.

    Parameters
    ----------
    only, csv_file, markdown, starting
        See `ResumedTable.rows`.

    Returns
    -------
    Iterator[EstimatorRow]
        Rows in the order of the table.
    """
    cases = estimator_cases()
    table = ResumedTable("estimators", cases, EstimatorRow, lambda case: measure_isolated(case), write_page)
    return table.rows(only, csv_file, markdown, starting)


def summary(rows: Sequence[EstimatorRow]) -> str:
    """Summarise rows: the numbers of scenes that agree, and the root mean square deviation."""
    compared = [row for row in rows if not row.remark]
    off = np.array([row.deviates for row in compared if row.error > 0])
    sentence = f"{int((off <= ALLOWED).sum())} of {len(off)} scenes agree within {ALLOWED:g} combined errors"
    if len(off):
        sentence += f", {int((off <= 2).sum())} within 2; the root mean square is {math.sqrt(np.mean(off**2)):.2f}"
    if len(off) < len(compared):
        sentence += f". {len(compared) - len(off)} have no light"
    if len(compared) < len(rows):
        sentence += f". {len(rows) - len(compared)} were not compared, see the remarks"
    return f"{sentence}. {len(rows)} of {len(estimator_cases())} scenes were run."


def write_page(rows: Sequence[EstimatorRow], file: Path, command: str) -> None:
    """Write the rows as a page that explains its columns.

    Parameters
    ----------
    rows : sequence of EstimatorRow
        The measured rows.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
    """
    table = markdown_table(headings(EstimatorRow), map(cells, rows), ("scene", "remark"))
    missing = not_measured(estimator_cases(), rows)
    write_text(file, _PAGE.format(command=command, summary=summary(rows), table=table, missing=missing))
