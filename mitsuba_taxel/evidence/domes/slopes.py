"""Table of `taxel bench slopes`: derivatives of readings at the default settings, compared with those on small
elements."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.domes.domes import dome_scene
from mitsuba_taxel.pads import CELL_SHAPES
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives

FORCES = ((0.0, 0.0, -0.8), (0.1, 0.03, -1.0))
"""Forces on one cell in N."""
PARAMETERS = ("fz", "fx", "youngs_modulus", "cell_size", "wall", "spacing")
FINE = 0.6
"""Mesh size in mm of the reference, half the default of cells with flat roofs."""

HEADINGS = ("cell", "force [N]", "by", "value", "unit", "stated", "deviation", "deviation / stated", "CPU s for all")

_PAGE = """\
# Derivatives

For users of derivatives who ask how well their stated errors hold.

Written by `{command}`; do not edit by hand.

This page compares derivatives of the reading of one cell, computed at the default settings, with derivatives on
elements of {fine:g} mm. For cells with flat roofs, these elements are half as large as the default; the error of the
reference is about a third of the deviation in the table. For loaded domes, the default elements are 0.625 mm
(spherical) and 0.75 mm (hemispheric): these rows show how much derivatives scatter between meshes of nearly the same
size, rather than an error. Roofs scatter isotropically. Both meshes use the same patches for the light, so the error
due to the patches is not part of the comparison; `tests/sensing/test_derivatives.py` bounds it with smaller patches.

{table}

- **by**: parameter with respect to which the reading is differentiated.
- **stated**: stated relative error (one standard deviation). **deviation**: relative difference from the derivative on
  small elements.
- **CPU s for all**: CPU time of all processors for six derivatives, after the pad is solved.
"""


@dataclass(frozen=True)
class SlopeRow:
    """Comparison of one derivative with its reference; `seconds` is the CPU time of all derivatives of the same
    state."""

    cell: str
    force: tuple[float, ...]
    parameter: str
    unit: str
    value: float
    stated: float
    truth: float
    seconds: float


def slopes(starting: Callable[[str], None] | None = None) -> Iterator[SlopeRow]:
    """Measure derivatives at several states of pads, and yield a row for each derivative; ``starting`` is called with
    the name of a state before it is measured.
    """
    for cell in CELL_SHAPES:
        for force in FORCES:
            if starting:
                starting(f"{cell}, {force} N")
            derivatives, seconds = _derivatives(cell, force, {})
            truth, _ = _derivatives(cell, force, {"mesh_size": FINE})
            for k, (name, unit) in enumerate(zip(PARAMETERS, derivatives.units, strict=True)):
                value, error = derivatives.values[0, k], derivatives.standard_errors[0, k]
                yield SlopeRow(cell, force, name, unit, value, error, truth.values[0, k], seconds)


def _derivatives(cell: str, force: Sequence[float], pad: dict[str, Any]) -> tuple[Derivatives, float]:
    scene = dome_scene(cell, {"scattering": "isotropic"}, force=list(force), **pad)
    live = scene.load()
    start = time.process_time()
    return derivatives_by([rates(scene, name) for name in PARAMETERS], live), time.process_time() - start


def slope_cells(row: SlopeRow) -> list[str]:
    """Format a row as table cells, in the order of `HEADINGS`."""
    deviation = row.value - row.truth
    force = ", ".join(f"{component:g}" for component in row.force)
    relative = f"{row.stated / abs(row.value):.2%}", f"{deviation / abs(row.truth):+.2%}"
    ratio, seconds = f"{abs(deviation) / row.stated:.2f}", f"{row.seconds:.1f}"
    return [row.cell, force, row.parameter, f"{row.value:.4e}", row.unit, *relative, ratio, seconds]


def summary(rows: Sequence[SlopeRow]) -> str:
    """Summarise rows: the numbers of derivatives within once and twice the stated error."""
    ratios = [abs(row.value - row.truth) / row.stated for row in rows]
    within = [sum(ratio <= bound for ratio in ratios) for bound in (1, 2)]
    return f"{within[0]} of {len(rows)} derivatives are within the stated error, {within[1]} within twice that."


def write_page(rows: Sequence[SlopeRow], file: Path, command: str) -> None:
    """Write rows as a page that explains its columns.

    Parameters
    ----------
    rows : sequence of SlopeRow
        All rows.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
    """
    table = markdown_table(HEADINGS, map(slope_cells, rows)) + f"\n\n{summary(rows)}"
    write_text(file, _PAGE.format(command=command, table=table, fine=FINE))
