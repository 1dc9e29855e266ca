"""Derivatives along lines of loaded designs on one mesh, by the width over which the step at the horizon is spread."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.coverage.domes import dome_scene
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import HORIZON_SHARE, derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.diffuse.deterministic_light import FINE
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells
from mitsuba_taxel.transport import reception
from mitsuba_taxel.transport.exchange import HORIZON

WIDER = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Widths, relative to the one in use."""
DESIGNS = 11
"""Along a line."""
POINTS = 32
"""Along a side of the phototransistor, for the readings at both ends that the mean derivative is compared with."""
DEGREE = 3
"""Of the polynomial that is taken off derivatives along a line to see how they scatter."""
SQUARE = {"cell_size": 2.75, "cell_height": 2.4, "height": 3.6, "wall": 0.8, "mesh_size": 1.6}
"""Dimensions in mm of a cell with a profile of square section, as in `docs/optimum.md`."""
PROFILE = "1 {}; 0.56 0.5; 0 0.5"
FIRST, LAST = 0.73, 0.75
"""z of the first point of its profile."""


def _square(z: float) -> Scene:
    moved = {} if z == FIRST else {"meshed_as": f"profile_z1={FIRST}"}
    about: dict[str, Any] = {"profile": PROFILE.format(z), "section": "square", "force": [0, 0, -2.2]} | SQUARE | moved
    return dome_scene("profile", {"scattering": "isotropic"}, **about)


def _box(fx: float) -> Scene:
    return dome_scene("parallelepiped", {"scattering": "isotropic"}, force=[fx, 0, -1.0])


LINES: dict[str, tuple[Callable[[float], Scene], str, float, float]] = {
    "square profile at -2.2 N": (_square, "profile_z1", FIRST, LAST),
    "parallelepiped at -1 N": (_box, "fx", 0.9, 1.5),
}
"""By name: the scene by the value of a parameter, that parameter, and the ends of the line."""


@dataclass(frozen=True)
class HorizonRow:
    """Derivatives along a line, relative to the mean slope between its ends of readings with more points on the
    phototransistor.

    Attributes
    ----------
    line, parameter : str
    width : float
        Cosine up to which a direction counts as along the horizon, between walls.
    bias : float
        Of the mean derivative.
    scatter : float
        Standard deviation of derivatives from a smooth curve.
    stated : float
        Root mean square of the part of the stated error that counts the horizon's width; NaN if it is not known.
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

Written by `{command}`; do not edit by hand.

Derivatives of the reading of a cell with an isotropic roof at {designs} designs or loads, from one to another on one
mesh, with the step at the [horizon](theory/derivatives.md#the-light-of-a-cell) spread over several widths (cosine).
{width:g} is in use between walls, and {wider:g} times as much as seen by a phototransistor. Readings do not depend on
it.

{table}

- **bias**: of the mean derivative, against the slope between the ends of the line of readings with {points} x {points}
  points on the phototransistor, and relative to it.
- **scatter**: standard deviation of the derivatives from a cubic along the line, relative to the same.
- **stated**: the part of the stated error that is for this, from the change with twice the width.
"""


def horizon(starting: Callable[[str], None] | None = None) -> Iterator[HorizonRow]:
    """Rows of the table, line by line; ``starting`` is called with the name of each."""
    for line, (scene, parameter, first, last) in LINES.items():
        if starting:
            starting(line)
        values = np.linspace(first, last, DESIGNS)
        slopes = np.array([_derivatives(scene(round(float(value), 6)), parameter) for value in values])
        mean = (_reading(scene(last)) - _reading(scene(first))) / (last - first)
        for number, wider in enumerate(WIDER):
            yield HorizonRow(line, parameter, HORIZON * wider, *_judged(values, slopes / mean, number))


def _reading(scene: Scene) -> float:
    """The power of the one taxel in W, with more points on the phototransistor."""
    cells = DiffuseCells(scene.load(), POINTS)
    patches = cells.patches(0)
    walls = patches.rest + patches.carried(cells.pad.state.displacement)
    return cells.taxels[0].power * cells.solved(0, cells.light_mesh(0, FINE), walls).reading


def _derivatives(scene: Scene, parameter: str) -> list[float]:
    """The derivatives of its reading with each width."""
    live, change = scene.load(), [rates(scene, parameter)]
    found = (derivatives_by(change, live, with_errors=False, wider=wider) for wider in WIDER)
    return [float(each.values[0, 0]) for each in found]


def _judged(values: np.ndarray, slopes: np.ndarray, number: int) -> tuple[float, float, float]:
    """Bias, scatter and stated error of derivatives (N, W) in units of the mean slope, with one of the widths."""
    of_width = slopes[:, number]
    bias = float(np.trapezoid(of_width, values) / np.ptp(values)) - 1
    smooth = np.polynomial.Polynomial.fit(values, of_width, DEGREE)(values)
    scatter = float(np.sqrt(np.square(of_width - smooth).sum() / (len(values) - DEGREE - 1)))
    if number + 1 == len(WIDER):
        return bias, scatter, float("nan")
    stated = HORIZON_SHARE * (slopes[:, number + 1] - of_width)
    return bias, scatter, float(np.sqrt(np.square(stated).mean()))


def write_page(rows: Sequence[HorizonRow], file: Path, command: str) -> None:
    """Write the rows as a page with an explanation of its columns."""
    table = markdown_table(headings(HorizonRow), map(cells, rows), headings(HorizonRow)[:2])
    about = {"designs": DESIGNS, "points": POINTS, "width": HORIZON, "wider": reception.WIDER}
    write_text(file, _PAGE.format(command=command, table=table, **about))
