"""Table of `taxel bench drags`: a body that is dragged to a position is compared with the same body pressed in at this
position.

Without friction, both lead to the same state, and the solver computes them in the same way. The dragged body therefore
has a tiny friction coefficient: its path is then followed step by step, on elements that are small along the path.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.peers.elements import mean_roof_displacement
from mitsuba_taxel.evidence.rows.isolated_process import measure_isolated
from mitsuba_taxel.evidence.rows.kind_examples import generator, indenter_of, other_cells, other_indenters, pad_of
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.evidence.rows.row_files import ResumedTable, not_measured
from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean, load_path, reactions
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.pads import CELL_SHAPES

SEED = 52
FRICTION = 1e-4
"""Friction coefficient of dragged bodies. The friction force is far below the errors of the elements."""
RADII, POSITIONS, DEPTH = (0.3, 0.5, 1.0), (0.4, 0.8, 1.2, 1.6, 2.0), 0.1
"""Radii, positions along x, and depth, in mm, of a grid of balls on a parallelepiped cell. The same number of balls has
radii from 0.3 to 3 mm, on the paper's cells, at random positions and depths."""
OTHER_CASES = 2
"""Number of cases with each other kind of cell, and with each other kind of indenter."""
ALLOWED, LARGEST = 2.0, 0.03
"""Largest allowed deviation, in combined errors, and relative to the value."""

_PAGE = """\
# Dragged and pressed indenters

For users of indenters with friction who ask whether dragged bodies are solved correctly.

Written by `{command}`; do not edit by hand.

**{summary}**

Each row compares two solutions for the same final state of a pad with one cell, on elements of the default size. In the
first, a body is pressed into the middle and dragged to its final position, with a coefficient of friction of
{friction:g}. In the second, the same body is pressed in at the final position, without friction. The two solutions have
different load steps, and elements that are small at different places: along the path of the body, or below its final
position. Forces and the mean displacement of the roof should agree within their stated errors. They agree better than
that, because elements of equal size around the body have similar errors.

The table follows; its columns are explained below it.

{table}

- **force**: force on the body that is pressed in. **deviation**: magnitude of the difference of the two force vectors,
  relative to this force.
- **stated**: root of the sum of squares of the two stated errors, relative to the force.
- **roof deviation**, **roof stated**: the same for the mean displacement of the roof.
- **combined errors**: the larger of the two deviations, each divided by its combined stated error (**stated** or **roof
  stated**).
- **CPU s**: CPU time of all processors, for both solutions with their errors.

{missing}
"""


@dataclass(frozen=True)
class DragRow:
    """Comparison of a dragged body with a pressed body; missing values are NaN.

    Attributes
    ----------
    force : float
        Force on the pressed body, in N.
    force_off, force_stated : float
        Deviation of the force on the dragged body, and combined stated error of both forces, relative to the force.
    roof_off, roof_stated : float
        The same for the mean displacement of the roof.
    seconds : float
        CPU time, in s.
    """

    COLUMNS: ClassVar = {
        "case": ("state", ""),
        "force": ("force [N]", ".4f"),
        "force_off": ("deviation", ".2%"),
        "force_stated": ("stated", ".2%"),
        "roof_off": ("roof deviation", ".2%"),
        "roof_stated": ("roof stated", ".2%"),
        "deviates": ("combined errors", ".2f"),
        "seconds": ("CPU s", ".0f"),
        "remark": ("remark", ""),
    }
    case: str
    remark: str = ""
    force: float = math.nan
    force_off: float = math.nan
    force_stated: float = math.nan
    roof_off: float = math.nan
    roof_stated: float = math.nan
    seconds: float = math.nan

    @property
    def deviates(self) -> float:
        """The larger of the deviations of force and roof displacement, each divided by its combined stated error."""
        return max(self.force_off / self.force_stated, self.roof_off / self.roof_stated)

    @property
    def agrees(self) -> bool:
        """Whether both deviations are below the allowed limits."""
        return self.deviates <= ALLOWED and max(self.force_off, self.roof_off) <= LARGEST


@dataclass(frozen=True)
class DragCase:
    """A body that is dragged to a position on a pad with one cell.

    Attributes
    ----------
    cell : str
        Shape of the cell.
    body : Indenter
        The body, without friction, at x = y = 0.
    position : tuple[float, float, float]
        Final position (x, y, -depth) of the body, in mm.
    """

    cell: str
    body: Indenter
    position: tuple[float, float, float]

    @property
    def name(self) -> str:
        """Description of the case: the label of its row in the table of the page."""
        x, y, z = self.position
        body = f"ball of {self.body.radius:g} mm" if self.body.shape == "sphere" else self.body.shape
        return f"{self.cell}, {body} at ({x:g}, {y:g}) mm, {-z:g} mm deep"

    def failed(self, end: str) -> DragRow:
        """Row of a case whose process ended without a result, for the reason ``end``."""
        return DragRow(self.name, end)

    def measured(self) -> DragRow:
        """Measure the dragged and the pressed body in this process, and return the row of the table."""
        start, (x, y, z) = time.process_time(), self.position
        try:
            _, dragged = self._states(replace(self.body, friction=FRICTION), (0, 0, z), self.position)
            (pressed,) = self._states(replace(self.body, at=(x, y)), (0, 0, z))
            row = self._compared(pressed, dragged)
        except ComputationError as error:
            row = DragRow(self.name, str(error))
        return replace(row, seconds=time.process_time() - start)

    def _states(self, body: Indenter, *positions: tuple[float, float, float]) -> list[State]:
        pad = pad_of(self.cell, rows=1, columns=1)
        return load_path(pad, NeoHookean(), positions, load=IndenterDisplacement(body))

    def _compared(self, pressed: State, dragged: State) -> DragRow:
        forces, roofs = [], []
        for state in (pressed, dragged):
            if state.error is None:
                return DragRow(self.name, "an error of the elements is unknown")
            forces.append((reactions(state).applied_force, state.force_error))
            roofs.append(
                (np.array([mean_roof_displacement(state.mesh, state.displacement, 1)]), state.error.displacement)
            )
        force = float(np.linalg.norm(forces[0][0]))
        force_off, force_stated = _relative_deviation(*forces)
        roof_off, roof_stated = _relative_deviation(*roofs)
        return DragRow(
            self.name,
            force=force,
            force_off=force_off,
            force_stated=force_stated,
            roof_off=roof_off,
            roof_stated=roof_stated,
        )


def _relative_deviation(pressed: tuple[np.ndarray, float], dragged: tuple[np.ndarray, float]) -> tuple[float, float]:
    """Deviation of the second value from the first, and combined stated error, both relative to the first value. Each
    argument is a value and its stated error."""
    (reference, reference_error), (value, error) = pressed, dragged
    size = np.linalg.norm(reference)
    return float(np.linalg.norm(value - reference) / size), float(math.hypot(reference_error, error) / size)


def drag_cases() -> list[DragCase]:
    """All cases: balls on a grid of positions alternate with random balls; other kinds of cells and indenters follow.

    Other kinds are taken from the registries, with separate random numbers, so that a newly registered kind does not
    change the other cases.
    """
    grid = [
        DragCase("parallelepiped", Indenter("sphere", radius=radius), (x, 0.0, -DEPTH))
        for x in POSITIONS
        for radius in RADII
    ]
    rng = np.random.default_rng(SEED)
    radii = rng.permutation(np.geomspace(0.3, 3.0, len(grid)))
    drawn = [_drawn_ball(CELL_SHAPES[k % len(CELL_SHAPES)], radius, rng) for k, radius in enumerate(radii)]
    cases = [case for pair in zip(grid, drawn, strict=True) for case in pair]
    for cell in other_cells():
        rng = generator(SEED, cell)
        cases += [_drawn_ball(cell, rng.uniform(0.5, 3.0), rng) for _ in range(OTHER_CASES)]
    for name in other_indenters(("sphere",)):
        rng = generator(SEED, name)
        for cell in rng.permutation(CELL_SHAPES)[:OTHER_CASES].tolist():
            x, y = np.round(rng.uniform(-1.0, 1.0, 2), 2).tolist()
            depth = float(f"{rng.uniform(0.05, 0.15):.2g}")
            cases.append(DragCase(cell, indenter_of(name), (x, y, -depth)))
    return cases


def _drawn_ball(cell: str, size: float, rng: np.random.Generator) -> DragCase:
    """A ball of radius ``size`` in mm, rounded to two digits, at a random position and depth."""
    radius = float(f"{size:.2g}")
    depth = float(f"{np.exp(rng.uniform(np.log(0.05), np.log(min(0.4, 0.4 * radius)))):.2g}")
    x, y = np.round(rng.uniform(-1.5, 1.5, 2), 2).tolist()
    return DragCase(cell, Indenter("sphere", radius=radius), (x, y, -depth))


def drags(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[DragRow]:
    """Measure each case of the table in a separate process, and yield its row.

    Parameters
    ----------
    only, csv_file, markdown, starting
        See `ResumedTable.rows`.

    Returns
    -------
    Iterator[DragRow]
        Rows in the order of the table.
    """
    table = ResumedTable("drags", drag_cases(), DragRow, lambda case: measure_isolated(case), write_page)
    return table.rows(only, csv_file, markdown, starting)


def summary(rows: Sequence[DragRow]) -> str:
    """Summarise rows: the numbers of cases that agree, that could not be solved, and that were run."""
    solved = [row for row in rows if not row.remark]
    sentence = (
        f"{sum(row.agrees for row in solved)} of {len(solved)} states agree within {ALLOWED:g} combined errors and "
        f"{LARGEST:.0%}"
    )
    if len(solved) < len(rows):
        sentence += f"; {len(rows) - len(solved)} could not be solved"
    return f"{sentence}; {len(rows)} of {len(drag_cases())} states were run."


def write_page(rows: Sequence[DragRow], file: Path, command: str) -> None:
    """Write the rows as a page that explains its columns.

    Parameters
    ----------
    rows : sequence of DragRow
        The measured rows.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
    """
    table = markdown_table(headings(DragRow), map(cells, rows), ("state", "remark"))
    missing = not_measured(drag_cases(), rows)
    text = _PAGE.format(command=command, friction=FRICTION, summary=summary(rows), table=table, missing=missing)
    write_text(file, text)
