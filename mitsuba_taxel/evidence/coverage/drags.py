"""The table of balls that are dragged to a place, beside the same balls pressed there.

Without friction both are one state, and are solved as one; the dragged ball rubs by next to nothing, so that its
elements are those along its way, and its states follow each other.
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
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.evidence.rows.row_files import ResumedTable
from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean, load_path, reactions
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.pads import CELL_SHAPES, Pad

SEED = 52
FRICTION = 1e-4
"""Of dragged balls: its force is far below the errors by the elements."""
RADII, PLACES, DEPTH = (0.3, 0.5, 1.0), (0.4, 0.8, 1.2, 1.6, 2.0), 0.1
"""In mm, of a grid of states: radii, places along x, and the depth, on a parallelepiped. As many more have radii from
0.3 to 3 mm, and shapes, places and depths drawn at random."""
ALLOWED, LARGEST = 2.0, 0.03
"""Deviations that are allowed, in combined errors and relative."""

_PAGE = """\
# Dragged and pressed

Written by `{command}`; do not edit by hand.

Balls on pads of one cell, with elements of the usual size, pressed into the middle and dragged to a place with a
friction of {friction:g}, beside the same balls pressed there without friction. The elements of the former are small
along the way, those of the latter below the ball, and the states are reached by different steps. Forces and the mean
displacement of the roof should agree within their stated errors; they are closer, as the elements around the ball are
of one size, and so are their errors.

**{summary}**

{table}

- **force**: of the ball that is pressed there. **deviation**: of that of the dragged ball, as a vector, relative.
- **stated**: the errors stated for the two, as the root of the sum of their squares, relative.
- **roof**: the same of the mean displacement of the roof.
- **CPU s**: time of all processors for both states with their errors.
"""


@dataclass(frozen=True)
class DragRow:
    """Result of a state; missing values are NaN.

    Attributes
    ----------
    force : float
        Of the ball that is pressed there, in N.
    force_off, force_stated : float
        Deviation of the dragged ball's, and the errors stated for both, relative.
    roof_off, roof_stated : float
        The same of the mean displacement of the roof.
    seconds : float
        Of processors' time.
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
        """The larger deviation, in combined errors."""
        return max(self.force_off / self.force_stated, self.roof_off / self.roof_stated)

    @property
    def agrees(self) -> bool:
        """Whether both deviations are allowed."""
        return self.deviates <= ALLOWED and max(self.force_off, self.roof_off) <= LARGEST


@dataclass(frozen=True)
class DragCase:
    """A ball of a ``radius`` at a place (x, y, -depth), all in mm, on one cell of a shape."""

    cell: str
    radius: float
    place: tuple[float, float, float]

    @property
    def name(self) -> str:
        """Words for the row."""
        x, y, z = self.place
        return f"{self.cell}, ball of {self.radius:g} mm at ({x:g}, {y:g}) mm, {-z:g} mm deep"

    def failed(self, end: str) -> DragRow:
        """The row of a process that returned none."""
        return DragRow(self.name, end)

    def measured(self) -> DragRow:
        """The row, measured in this process."""
        began, (x, y, z) = time.process_time(), self.place
        dragged = Indenter("sphere", radius=self.radius, friction=FRICTION)
        try:
            (_, there), (pressed,) = (
                self._states(dragged, (0, 0, z), self.place),
                self._states(Indenter("sphere", radius=self.radius, at=(x, y)), (0, 0, z)),
            )
            row = self._compared(pressed, there)
        except ComputationError as error:
            row = DragRow(self.name, str(error))
        return replace(row, seconds=time.process_time() - began)

    def _states(self, ball: Indenter, *places: tuple[float, float, float]) -> list[State]:
        return load_path(Pad(self.cell, 1, 1), NeoHookean(), places, load=IndenterDisplacement(ball))

    def _compared(self, pressed: State, dragged: State) -> DragRow:
        forces, roofs = [], []
        for state in (pressed, dragged):
            if state.error is None:
                return DragRow(self.name, "an error of the elements is unknown")
            forces.append(np.append(reactions(state).applied_force, state.force_error))
            roofs.append(
                np.array([mean_roof_displacement(state.mesh, state.displacement, 1), state.error.displacement])
            )
        figures = [float(np.linalg.norm(forces[0][:3])), *_deviation(forces), *_deviation(roofs)]
        return DragRow(self.name, "", *figures)


def _deviation(figures: Sequence[np.ndarray]) -> tuple[float, float]:
    """Of the second from the first, and their stated errors, which come last, relative to the first."""
    size = np.linalg.norm(figures[0][:-1])
    off = np.linalg.norm(figures[1][:-1] - figures[0][:-1])
    return float(off / size), float(math.hypot(figures[0][-1], figures[1][-1]) / size)


def drag_cases() -> list[DragCase]:
    """All states, those of a grid and those drawn in turn."""
    grid = [DragCase("parallelepiped", radius, (x, 0.0, -DEPTH)) for x in PLACES for radius in RADII]
    rng = np.random.default_rng(SEED)
    drawn = []
    for number, size in enumerate(rng.permutation(np.geomspace(0.3, 3.0, len(grid)))):
        radius = float(f"{size:.2g}")
        depth = float(f"{np.exp(rng.uniform(np.log(0.05), np.log(min(0.4, 0.4 * radius)))):.2g}")
        x, y = np.round(rng.uniform(-1.5, 1.5, 2), 2).tolist()
        drawn.append(DragCase(CELL_SHAPES[number % len(CELL_SHAPES)], radius, (x, y, -depth)))
    return [case for pair in zip(grid, drawn, strict=True) for case in pair]


def drags(
    only: str | None = None,
    csv_file: Path | None = None,
    markdown: Path | None = None,
    starting: Callable[[int, int, str], None] | None = None,
) -> Iterator[DragRow]:
    """Rows of the table as they are measured, each in a process of its own; see `ResumedTable.rows`."""
    made = ResumedTable("drags", drag_cases(), DragRow, lambda case: measure_isolated(case), write_page)
    return made.rows(only, csv_file, markdown, starting)


def summary(rows: Sequence[DragRow]) -> str:
    """A sentence with the number of states that agree, of how many."""
    solved = [row for row in rows if not row.remark]
    said = (
        f"{sum(row.agrees for row in solved)} of {len(solved)} states agree within {ALLOWED:g} combined errors and "
        f"{LARGEST:.0%}"
    )
    if len(solved) < len(rows):
        said += f"; {len(rows) - len(solved)} could not be solved"
    return f"{said}; {len(rows)} of {len(drag_cases())} states were run."


def write_page(rows: Sequence[DragRow], file: Path, command: str) -> None:
    """Write the rows as a page with an explanation of its columns."""
    table = markdown_table(headings(DragRow), map(cells, rows), ("state", "remark"))
    write_text(file, _PAGE.format(command=command, friction=FRICTION, summary=summary(rows), table=table))
