"""CPU time, memory and error of one reading, for pads with an increasing number of cells."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mitsuba_taxel import PadSensor, measure
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.processes.system import peak_memory
from mitsuba_taxel.evidence.rows.isolated_process import measure_isolated
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE, IndenterDisplacement, Load
from mitsuba_taxel.mechanics.load_paths import load_path
from mitsuba_taxel.pads.parametric.pad import Pad

PER_CELL = -1.0
"""Normal force in N per cell of the pad."""
MEMORY = 24 * 2**30
"""Memory limit of a process in bytes. It includes reserved memory: a solver reserves up to 5 GB for stacks."""
BALL = IndenterDisplacement(Indenter("sphere", radius=4.0, at=(0.9, 0.4)))
"""A ball off the centre, under which the loaded pad has no symmetry."""
DEPTH = -0.3
"""Displacement of the ball in mm."""


@dataclass(frozen=True)
class ManyCellsRow:
    """Cost and error of one reading of a pad.

    Attributes
    ----------
    case : str
        Number of cells, and load, in words.
    elements : float
        Number of finite elements of the whole pad.
    mechanics : float
        CPU seconds of mesh and load path.
    second_mesh : float
        CPU seconds of the second mesh, which gives the error of the finite elements.
    reading : float
        CPU seconds of the light.
    mechanics_error : float
        Relative error of the worst reading due to the finite elements; NaN if unknown.
    light_error : float
        Relative error of the worst reading due to the light and to flat triangles.
    megabytes : float
        Peak memory in MB.
    end : str
        How the process ended.
    cells : int
        Number of cells.
    """

    COLUMNS: ClassVar = {
        "case": ("case", ""),
        "elements": ("elements", ".0f"),
        "mechanics": ("path, CPU s", ".1f"),
        "second_mesh": ("second mesh, CPU s", ".1f"),
        "reading": ("light, CPU s", ".1f"),
        "mechanics_error": ("error by elements", ".2%"),
        "light_error": ("by light", ".2%"),
        "megabytes": ("MB", ".0f"),
        "end": ("end", ""),
    }
    case: str
    cells: int
    end: str = "read"
    elements: float = math.nan
    mechanics: float = math.nan
    second_mesh: float = math.nan
    reading: float = math.nan
    mechanics_error: float = math.nan
    light_error: float = math.nan
    megabytes: float = math.nan

    @property
    def seconds(self) -> float:
        """CPU seconds of all stages."""
        return self.mechanics + self.second_mesh + self.reading


@dataclass(frozen=True)
class ManyCells:
    """A square pad with parallelepiped cells under a load.

    Attributes
    ----------
    side : int
        Number of rows, and of columns, of cells.
    under_ball : bool
        Whether a ball presses on the pad beside its centre, instead of a force spread over the top.
    """

    side: int
    under_ball: bool

    @property
    def name(self) -> str:
        return f"{self.side} x {self.side}, {'ball off the centre' if self.under_ball else 'spread force'}"

    def failed(self, end: str) -> ManyCellsRow:
        """The result of a case whose process ended without a result, for the reason ``end``."""
        return ManyCellsRow(self.name, self.side**2, end)

    def measured(self) -> ManyCellsRow:
        """Measure time, memory and error of one reading of this pad in the present process."""
        pad, cells = Pad("parallelepiped", rows=self.side, columns=self.side), self.side**2
        load: Load = BALL if self.under_ball else SPREAD_FORCE
        value = (0.0, 0.0, DEPTH if self.under_ball else PER_CELL * cells)
        sensor = PadSensor(pad, force=value, load=load)

        # The state and its error, then the reading, which reuses both.
        times = [time.process_time()]
        try:
            (state,) = load_path(pad, sensor.material, [value], load=load)
            times.append(time.process_time())
            _ = state.error
            times.append(time.process_time())
            readings = measure(sensor.scene())
        except ComputationError as error:
            return self.failed(str(error))
        times.append(time.process_time())
        mechanics, second_mesh, reading = np.diff(times).tolist()
        return ManyCellsRow(
            case=self.name,
            cells=cells,
            elements=float(len(state.mesh.tets)),
            mechanics=mechanics,
            second_mesh=second_mesh,
            reading=reading,
            mechanics_error=float(np.max(readings.mechanics_error / readings.power)),
            light_error=float(np.max(np.hypot(readings.standard_error, readings.geometry_error) / readings.power)),
            megabytes=peak_memory(),
        )


def many_cells(
    sides: Sequence[int], under_ball: bool, seconds: float, starting: Callable[[str], None]
) -> Iterator[ManyCellsRow]:
    """Measure one reading of each of several pads, each in a separate process.

    Parameters
    ----------
    sides : sequence of int
        Number of rows, and of columns, of cells of each pad.
    under_ball : bool
        Whether a ball presses on the pad beside its centre, instead of a force spread over the top. See
        :class:`ManyCells`.
    seconds : float
        Largest wall time in s for each pad.
    starting : Callable[[str], None]
        Called with the name of each case before it is measured.

    Yields
    ------
    ManyCellsRow
        One row for each pad.
    """
    for side in sides:
        case = ManyCells(side, under_ball)
        starting(case.name)
        yield measure_isolated(case, seconds, MEMORY)


def growth(rows: Sequence[ManyCellsRow]) -> float:
    """Fit the exponent of the growth of CPU time with the number of cells, by least squares.

    Parameters
    ----------
    rows : sequence of ManyCellsRow
        Results of the pads; those without a reading are left out.

    Returns
    -------
    float
        The exponent: 1 if the time is proportional to the number of cells. NaN for fewer than two pads.
    """
    read = [row for row in rows if math.isfinite(row.seconds)]
    if len({row.cells for row in read}) < 2:
        return math.nan
    return float(np.polyfit(np.log([row.cells for row in read]), np.log([row.seconds for row in read]), 1)[0])


def growth_line(rows: Sequence[ManyCellsRow]) -> str:
    """Describe the exponent of :func:`growth` in a sentence."""
    power = growth(rows)
    return "" if math.isnan(power) else f"CPU time grows as the number of cells to the power of {power:.2f}."
