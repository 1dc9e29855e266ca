"""Table of `taxel bench horizon`: derivatives of readings along lines of loaded designs on one mesh, for several widths
over which the step of isotropic light at the horizon is smoothed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.domes.domes import dome_scene
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import HORIZON_SHARE, derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.diffuse.deterministic_light import FINE
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells
from mitsuba_taxel.transport import reception
from mitsuba_taxel.transport.exchange import HORIZON

WIDER = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Widths, relative to the default."""
DESIGNS = 11
"""Number of designs along a line."""
POINTS = 32
"""Number of points along a side of the phototransistor for the readings at both ends of a line."""
DEGREE = 3
"""Degree of the polynomial that is subtracted from the derivatives along a line, to compute their scatter."""
SQUARE = {"cell_size": 2.75, "cell_height": 2.4, "height": 3.6, "wall": 0.8, "mesh_size": 1.6}
"""Dimensions in mm of a cell with a profile of square section, as in `docs/optimum.md`."""
PROFILE = "1 {}; 0.56 0.5; 0 0.5"
FIRST, LAST = 0.73, 0.75
"""z of the first point of its profile."""


def _square(z: float) -> Scene:
    cell: dict[str, Any] = {"profile": PROFILE.format(z), "section": "square", **SQUARE}
    if z != FIRST:
        cell["meshed_as"] = f"profile_z1={FIRST}"
    return dome_scene("profile", {"scattering": "isotropic"}, force=[0, 0, -2.2], **cell)


def _box(fx: float) -> Scene:
    return dome_scene("parallelepiped", {"scattering": "isotropic"}, force=[fx, 0, -1.0])


LINES: dict[str, tuple[Callable[[float], Scene], str, float, float]] = {
    "square profile at -2.2 N": (_square, "profile_z1", FIRST, LAST),
    "parallelepiped at -1 N": (_box, "fx", 0.9, 1.5),
}
"""Lines by name: scene as a function of a parameter, name of the parameter, and its values at both ends."""


@dataclass(frozen=True)
class HorizonRow:
    """Errors of derivatives along one line of designs with one width, relative to the mean slope between the ends of
    the line. The mean slope follows from readings with more quadrature points on the phototransistor.

    Attributes
    ----------
    line, parameter : str
        Name of the line, and the parameter that changes along it.
    width : float
        Width over which the step at the horizon is smoothed for light between walls, as the cosine of an angle.
    bias : float
        Mean derivative minus mean slope.
    scatter : float
        Standard deviation of the derivatives from a smooth curve.
    stated : float
        Root mean square of the stated error due to the width; NaN if unknown.
    """

    COLUMNS: ClassVar = {
        "line": ("line of designs", ""),
        "parameter": ("by", ""),
        "width": ("width", ".3g"),
        "bias": ("bias", "+.2%"),
        "scatter": ("scatter", ".2%"),
        "stated": ("stated", ".2%"),
    }
    line: str
    parameter: str
    width: float
    bias: float
    scatter: float
    stated: float


_PAGE = """\
# The width of the horizon

For people who change how derivatives are computed.

Written by `{command}`; do not edit by hand.

Light from an isotropic wall ends with a step at the [horizon](theory/derivatives.md#the-light-of-a-cell) of each point.
For derivatives, the program smooths this step over a range of the cosine. This page compares several widths of that
range. Each line consists of {designs} designs or loads of a cell with an isotropic roof, on one mesh. The program uses
a width of {width:g} between walls, and {wider:g} times this width between walls and a phototransistor. Readings do not
depend on the width.

{table}

- **by**: parameter that changes along the line, with respect to which the reading is differentiated.
- **bias**: relative deviation of the mean derivative from the slope between the ends of the line. The slope follows
  from readings with {points} x {points} points on the phototransistor.
- **scatter**: standard deviation of the derivatives from a cubic polynomial along the line, relative to this slope.
- **stated**: part of the stated error due to the width, from the change of the derivative with twice the width.
"""


def horizon(starting: Callable[[str], None] | None = None) -> Iterator[HorizonRow]:
    """Measure errors of derivatives along lines of designs, and yield the rows of each line; ``starting`` is called
    with the name of a line before it is measured.
    """
    for line, (scene, parameter, first, last) in LINES.items():
        if starting:
            starting(line)
        values = np.linspace(first, last, DESIGNS)
        slopes = np.array([_derivatives(scene(round(float(value), 6)), parameter) for value in values])
        mean = (_reading(scene(last)) - _reading(scene(first))) / (last - first)
        for number, factor in enumerate(WIDER):
            yield HorizonRow(line, parameter, HORIZON * factor, *_bias_scatter_and_error(values, slopes / mean, number))


def _reading(scene: Scene) -> float:
    """Power in W on the phototransistor of the only taxel, with more quadrature points on it."""
    cells = DiffuseCells(scene.load(), POINTS)
    patches = cells.patches(0)
    walls = patches.rest + patches.carried(cells.pad.state.displacement)
    return cells.taxels[0].power * cells.solved(0, cells.light_mesh(0, FINE), walls).reading


def _derivatives(scene: Scene, parameter: str) -> list[float]:
    """Derivatives of the reading of a scene with respect to a parameter, one for each width in `WIDTHS`."""
    live, change = scene.load(), [rates(scene, parameter)]
    results = (derivatives_by(change, live, with_errors=False, wider=factor) for factor in WIDER)
    return [float(result.values[0, 0]) for result in results]


def _bias_scatter_and_error(values: np.ndarray, slopes: np.ndarray, number: int) -> tuple[float, float, float]:
    """Bias, scatter and stated error for the width with the index ``number``, from derivatives (N, W) at N designs with
    W widths, relative to the mean slope."""
    of_width = slopes[:, number]
    bias = float(np.trapezoid(of_width, values) / np.ptp(values)) - 1
    smooth = np.polynomial.Polynomial.fit(values, of_width, DEGREE)(values)
    scatter = float(np.sqrt(np.square(of_width - smooth).sum() / (len(values) - DEGREE - 1)))
    if number + 1 == len(WIDER):
        return bias, scatter, float("nan")
    horizon_error = HORIZON_SHARE * (slopes[:, number + 1] - of_width)
    return bias, scatter, float(np.sqrt(np.square(horizon_error).mean()))


def write_page(rows: Sequence[HorizonRow], file: Path, command: str) -> None:
    """Write rows as a page that explains its columns.

    Parameters
    ----------
    rows : sequence of HorizonRow
        All rows.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
    """
    table = markdown_table(headings(HorizonRow), map(cells, rows), headings(HorizonRow)[:2])
    about = {"designs": DESIGNS, "points": POINTS, "width": HORIZON, "wider": reception.WIDER}
    write_text(file, _PAGE.format(command=command, table=table, **about))
