"""Derivatives of readings at the default settings, compared with those on small elements."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.coverage.domes import dome_scene
from mitsuba_taxel.pads import CELL_SHAPES
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives

FORCES = ((0.0, 0.0, -0.8), (0.1, 0.03, -1.0))
"""Forces on one cell in N."""
PARAMETERS = ("fz", "fx", "youngs_modulus", "cell_size", "wall", "spacing")
FINE = 0.6
"""Mesh size in mm of the truth, half the default of boxes and cylinders."""

HEADINGS = ("cell", "force [N]", "by", "value", "unit", "stated", "deviation", "deviation / stated", "CPU s for all")

_PAGE = """\
# Derivatives

Written by `{command}`; do not edit by hand.

Derivatives of one cell's reading at the default settings, compared with those on elements of {fine:g} mm. These are
half as large as those of boxes and cylinders, and their own error is about a third of the deviation given here.
Loaded domes have elements of 0.625 mm (spherical) and 0.75 mm (hemispheric): their rows tell how much slopes
scatter from one mesh to another of nearly the same size, rather than how far they are off. Roofs scatter
isotropically. Both use the same patches for the light: their error is not part of the comparison, and is bounded
with smaller ones in `tests/sensing/test_derivatives.py`.

{table}

- **stated**: one standard deviation, relative; **deviation**: relative to the value on small elements.
- **CPU s for all**: seconds of all processors for six derivatives, after the pad has been solved for.
"""


@dataclass(frozen=True)
class SlopeRow:
    """One derivative; `seconds` are those of all of its state."""

    cell: str
    force: tuple[float, ...]
    parameter: str
    unit: str
    value: float
    stated: float
    truth: float
    seconds: float


def slopes(starting: Callable[[str], None] | None = None) -> Iterator[SlopeRow]:
    """Rows of the table as they are measured; ``starting`` is called with the name of each state."""
    for cell in CELL_SHAPES:
        for force in FORCES:
            if starting:
                starting(f"{cell}, {force} N")
            found, seconds = _derivatives(cell, force, {})
            truth, _ = _derivatives(cell, force, {"mesh_size": FINE})
            for k, name in enumerate(PARAMETERS):
                value, stated, expected = found.values[0, k], found.standard_errors[0, k], truth.values[0, k]
                yield SlopeRow(cell, force, name, found.units[k], value, stated, expected, seconds)


def _derivatives(cell: str, force: Sequence[float], pad: dict[str, Any]) -> tuple[Derivatives, float]:
    scene = dome_scene(cell, {"scattering": "isotropic"}, force=list(force), **pad)
    live = scene.load()
    start = time.process_time()
    return derivatives_by([rates(scene, name) for name in PARAMETERS], live), time.process_time() - start


def slope_cells(row: SlopeRow) -> list[str]:
    """The row as text, below `HEADINGS`."""
    off = row.value - row.truth
    force = ", ".join(f"{component:g}" for component in row.force)
    relative = f"{row.stated / abs(row.value):.2%}", f"{off / abs(row.truth):+.2%}", f"{abs(off) / row.stated:.2f}"
    return [row.cell, force, row.parameter, f"{row.value:.4e}", row.unit, *relative, f"{row.seconds:.1f}"]


def summary(rows: Sequence[SlopeRow]) -> str:
    """Sentence with the numbers of rows within once and twice the stated error."""
    ratios = [abs(row.value - row.truth) / row.stated for row in rows]
    within = [sum(ratio <= bound for ratio in ratios) for bound in (1, 2)]
    return f"{within[0]} of {len(rows)} derivatives are within the stated error, {within[1]} within twice that."


def write_page(rows: Sequence[SlopeRow], file: Path, command: str) -> None:
    """Write the rows as a page with an explanation of its columns."""
    table = markdown_table(HEADINGS, map(slope_cells, rows)) + f"\n\n{summary(rows)}"
    write_text(file, _PAGE.format(command=command, table=table, fine=FINE))
