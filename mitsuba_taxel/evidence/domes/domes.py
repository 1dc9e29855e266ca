"""Table of `taxel bench domes`: readings compared with references. Without a load the reference is quadrature over the
exact roof; under a load it is the reading on much smaller elements."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.domes.flat_roof_light import FlatRoof
from mitsuba_taxel.evidence.domes.sphere_light import BOARD, DOMES, SPACING, Dome
from mitsuba_taxel.evidence.rows.kind_examples import cell_parameters, other_cells, pad_of
from mitsuba_taxel.pads import CELL_SHAPES, Pad
from mitsuba_taxel.pads.cells.cell_shape import CellShape, LightSizes
from mitsuba_taxel.pads.cells.profile import Profile
from mitsuba_taxel.sensing import Readings, Scene, measure

Force = tuple[float, float, float]
"""In N."""

WALLS: dict[str, dict[str, Any]] = {
    "lambertian": {"scattering": "lambertian"},
    "isotropic": {"scattering": "isotropic"},
    "mirror": {"scattering": "mirror"},
    "rough mirror": {"scattering": "rough_mirror", "rms_slope": 2.0},
}
CASES = (
    (1, (0.0, 0.0, 0.0)),
    (3, (0.0, 0.0, 0.0)),
    (1, (0.0, 0.0, -1.0)),
    (1, (0.0, 0.0, -2.0)),
    (3, (0.0, 0.0, -2.0)),
    (1, (0.6, 0.0, -2.0)),
    (1, (0.2, 0.2, -0.6)),
    (3, (0.6, 0.0, -2.0)),
)
"""For the paper's domes: number of cells along each side of the pad, and force on each cell in N."""
OTHER_CASES = ((1, (0.0, 0.0, 0.0)), (1, (0.0, 0.0, -1.0)))
"""The same for each other registered cell shape."""
FINE = {1: 0.25, 3: 0.4}
"""Mesh size in mm of the reference under normal forces, by the number of cells along a side."""
FINE_ASIDE = {1: 0.3, 3: 0.4}
"""The same under tangential forces, for which half of the pad is solved, instead of an eighth. For 3 x 3 cells, this
takes too much memory: the stability of their reference is tested on the default elements, and the reference is solved
with the symmetry of the pad, as readings are."""
PADS: tuple[tuple[float, dict[str, float]], ...] = (
    (-1.0, {}),
    (-2.0, {}),
    (-2.0, {"cell_size": 3.2, "pitch": 4.3, "height": 5.2, "wall": 0.9}),
    (-1.0, {"wall": 0.7, "height": 4.2}),
    (-2.5, {"cell_size": 2.2, "wall": 1.2}),
    (-1.2, {"youngs_modulus": 2.0}),
)
"""Pads with one hemispheric mirror: force in N, and parameters that differ from the default, in mm and MPa."""
LARGER, SMALLEST = 1.25, 0.3
"""Mesh sizes in mm of these pads: an additional size that is tested as well as the default, and that of the
reference."""
POINTS, RAYS = 1 << 13, 1 << 19
"""Number of points per replicate for all taxels with a mirror together; number of rays in each of the 16 runs of a
reference."""
MORE_POINTS = {("spherical", "rough mirror"): 16}
"""Factor of the number of points for cells in which few paths carry the light."""

PAD_HEADINGS = ("pad", "load [N]", "reference [W/W]", "deviation", "noise", "stated", f"deviation, {LARGER:g} mm")
HEADINGS = ("cell", "roof", "cells", "N per cell", "reference [W/W]", "deviation", "noise", "stated for the shape")

_PAGE = """\
# Domes

For users of domes and of cells with mirrors who ask whether their readings are right.

Written by `{command}`; do not edit by hand.

**{summary}**

This page compares readings at the default settings with independent reference values. It covers domes in detail, and
all other cell shapes.

- **Unloaded cells** with a spherical or a flat, round roof: the shape of the roof is known exactly. The reference is a
  quadrature for diffuse walls, or ray tracing on the exact roof for mirrors. Neither uses finite elements, triangles or
  a renderer (`mitsuba_taxel/evidence/domes/sphere_light.py` and `flat_roof_light.py`). The cell `profile` has the
  profile of the hemisphere.
- **Other unloaded cells** have no such reference. They are compared with a simulation on smaller elements.
- **Loaded cells** are compared with a simulation on elements of {fine[1]:g} mm (1 x 1 cells), {aside[1]:g} mm (1 x 1
  under tangential forces) or {fine[3]:g} mm (3 x 3). The default size is 0.625 to 0.75 mm for domes, and for flat roofs
  with mirrors. For 3 x 3 cells under tangential forces, stability is tested on elements of {judge:g} mm in both
  simulations.

The table follows; its columns are explained below it.

{table}

- **N per cell**: force per cell in N. A single number is along z; three numbers are along x, y and z.
- **reference [W/W]**: power of the reference, mean of all taxels, per watt that an LED emits.
- **deviation**: relative deviation of the mean of all taxels from the reference. **noise**: standard error of the
  deviation.
- **stated for the shape**: stated relative error due to the geometry and, under load, the mechanics.
- **rough mirror**: root-mean-square slope of 2 degrees.

## Mirrors of other pads
Each row is one hemispheric cell with a mirror roof. Readings on elements of the default size, and on elements of
{larger:g} mm, are compared with a reading on elements of {smallest:g} mm. The column **stated** is the stated
relative error at the default size.

{pads}
"""


@dataclass(frozen=True)
class DomeRow:
    """A row of the table of domed cells: one reading compared with its reference. `load` is in N and `truth`, the
    reference value, in W; `deviation`, `noise` and `stated` are relative to it.
    """

    cell: str
    wall: str
    cells: int
    load: Force
    truth: float
    deviation: float
    noise: float
    stated: float


@dataclass(frozen=True)
class PadRow:
    """A row of the table of pads with mirrors: one reading compared with its reference. `load` is in N and `truth`, the
    reference value, in W; all other numbers are relative to it.
    """

    pad: str
    load: float
    truth: float
    deviation: float
    noise: float
    stated: float
    deviation_larger: float


def dome_scene(cell: str, roof: dict[str, Any], cells: int = 1, **pad: Any) -> Scene:
    """Make a scene of cells above LEDs without a hole; all walls except the roof absorb.

    Parameters
    ----------
    cell : str
        Shape of the cells.
    roof : dict
        Parameters of the `wall` of the roof.
    cells : int
        Number of cells along each side of the pad.
    **pad : Any
        Other parameters of the pad.

    Returns
    -------
    Scene
        Scene with a photo-reflector in each cell.
    """
    walls = {"type": "region", "roof": {"type": "wall", **roof}}
    reflector = {"type": "photo_reflector", "rows": cells, "columns": cells, "spacing": SPACING}
    reflector |= {"led": {"type": "annular_led", "hole": 0.0}, "detector": {"type": "phototransistor"}}
    pad = {"type": "deformable_pad", "cell": cell, "rows": cells, "columns": cells, "walls": walls, **pad}
    return Scene({"type": "scene", "integrator": {"type": "taxel_tracer"}, "pad": pad, "packages": reflector})


def domes(starting: Callable[[str], None] | None = None) -> Iterator[DomeRow]:
    """Measure the rows of the table of domed cells, and yield each; ``starting`` is called with the name of a row
    before it is measured.
    """
    for cell in (*DOMES, *(cell for cell in CELL_SHAPES if cell not in DOMES), *other_cells()):
        for name in WALLS:
            exact = None
            for cells, load in CASES if cell in DOMES else OTHER_CASES:
                if starting:
                    starting(f"{cell}, {name}, {cells} x {cells}, {_listed(load)} N per cell")
                exact = exact or _on_exact_roof(cell, name)
                truth = exact if exact and not any(load) else _on_small_elements(cell, name, cells, load)
                yield _row(cell, name, cells, load, truth)


def mirrors_of_pads(starting: Callable[[str], None] | None = None) -> Iterator[PadRow]:
    """Measure the error of readings below mirrors in the pads of :data:`PADS`, and yield a row for each;
    ``starting`` is called with the name of a row before it is measured.
    """
    for load, changes in PADS:
        pad = ", ".join(f"{name} = {value:g}" for name, value in changes.items()) or "default"
        if starting:
            starting(f"hemispheric, mirror, {pad}, {load:g} N")
        parameters: dict[str, Any] = {"force": [0, 0, load], **changes}
        default = measure(dome_scene("hemispheric", WALLS["mirror"], **parameters), points=POINTS, seed=1)
        larger, truth = (
            measure(
                dome_scene("hemispheric", WALLS["mirror"], mesh_size=size, **parameters),
                points=POINTS,
                seed=2,
                mechanics_error=False,
            )
            for size in (LARGER, SMALLEST)
        )
        (power, error), (value, truth_error) = _mean(default), _mean(truth)
        noise, stated_error = math.hypot(error, truth_error) / value, stated_for_shape(default)
        yield PadRow(pad, load, value, power / value - 1, noise, stated_error, _mean(larger)[0] / value - 1)


def stated_for_shape(readings: Readings) -> float:
    """Stated relative error of readings due to the pad's shape: facets of its surface, and finite elements."""
    return math.hypot(readings.error_budget["geometry"], readings.error_budget["mechanics"])


def _row(cell: str, name: str, cells: int, load: Force, truth: tuple[float, float]) -> DomeRow:
    scene = dome_scene(cell, WALLS[name], cells, force=_on_pad(load, cells), **cell_parameters(cell))
    readings = measure(scene, points=_points(cell, name, cells), seed=1)
    power, error = _mean(readings)
    value, truth_error = truth
    noise = math.hypot(error, truth_error) / value
    return DomeRow(cell, name, cells, load, value, power / value - 1, noise, stated_for_shape(readings))


def _on_exact_roof(cell: str, name: str) -> tuple[float, float] | None:
    """Reference value of an unloaded cell: power in W on its phototransistor, and standard error.

    The result is None if the roof is neither spherical nor flat and round.
    """
    pad, wall = pad_of(cell, rows=1, columns=1), WALLS[name]
    roof: Dome | FlatRoof
    if cell == Profile.name:  # `pad_of` gives it the meridian of a hemisphere
        roof = DOMES["hemispheric"]
    elif cell in DOMES:
        roof = DOMES[cell]
    elif "roof" not in pad.shape.round_regions and not pad.shape.is_square:
        roof = FlatRoof(float(pad.shape.outline()[-2, 0]), pad.top_of_cell - BOARD, SPACING)
    else:
        return None
    if "mirror" in name:
        return roof.mirror_power(wall.get("rms_slope", 0.0), seed=1, points=RAYS)
    return roof.diffuse_power(wall["scattering"], 24), 0.0


def _on_small_elements(cell: str, name: str, cells: int, load: Force) -> tuple[float, float]:
    """Reference value of a loaded cell, from small elements: power in W on its phototransistor, and standard error."""
    size = (FINE_ASIDE if any(load[:2]) else FINE)[cells]
    by_parts = cells > 1 and any(load[:2])
    mesh = {} if by_parts else {"mesh_size": size}
    scene = dome_scene(cell, WALLS[name], cells, force=_on_pad(load, cells), **cell_parameters(cell), **mesh)
    with _default_elements(cell, size) if by_parts else nullcontext():
        return _mean(measure(scene, points=_points(cell, name, cells), seed=2, mechanics_error=False))


@contextmanager
def _default_elements(cell: str, size: float) -> Iterator[None]:
    """Context manager: change the default size of the elements of a loaded pad to ``size`` mm."""
    relative = size / Pad(cell).default_mesh_size
    shape = CellShape.named(cell)
    default_sizes = shape.light_sizes
    try:
        shape.light_sizes = LightSizes(diffuse=relative, mirrors=relative, mirrors_side_by_side=relative)
        yield
    finally:
        shape.light_sizes = default_sizes


def _on_pad(load: Force, cells: int) -> list[float]:
    """Force on the whole pad in N, from the force on each cell."""
    return [component * cells**2 for component in load]


def _listed(load: Force) -> str:
    """A force as text: the normal component only if the others are 0."""
    return ", ".join(f"{component:g}" for component in (load if any(load[:2]) else load[2:]))


def _points(cell: str, name: str, cells: int) -> int | None:
    """Number of points per replicate and taxel; None for diffuse walls, which need no random paths."""
    return MORE_POINTS.get((cell, name), 1) * POINTS // cells**2 if "mirror" in name else None


def _mean(readings: Readings) -> tuple[float, float]:
    """Mean power in W of all taxels, which are equal by symmetry, and its standard error."""
    means = readings.replicates.mean(axis=1)
    return float(means.mean()), float(np.std(means, ddof=1) / math.sqrt(len(means)))


def dome_cells(row: DomeRow) -> list[str]:
    """Format a row as table cells, in the order of `HEADINGS`."""
    relative = f"{row.deviation:+.3%}", f"{row.noise:.3%}", f"{row.stated:.3%}"
    return [row.cell, row.wall, f"{row.cells} x {row.cells}", _listed(row.load), f"{row.truth:.6g}", *relative]


def pad_cells(row: PadRow) -> list[str]:
    """Format a row as table cells, in the order of `PAD_HEADINGS`."""
    relative = f"{row.deviation:+.2%}", f"{row.noise:.2%}", f"{row.stated:.2%}", f"{row.deviation_larger:+.2%}"
    return [row.pad, f"{row.load:g}", f"{row.truth:.6g}", *relative]


def summary(rows: Sequence[DomeRow]) -> str:
    """Summarise rows: the number of readings within twice their stated error plus three times the noise, and the names
    of all other readings."""
    beyond = [row for row in rows if abs(row.deviation) > 2 * row.stated + 3 * row.noise]
    names = "; ".join(f"{row.cell}, {row.wall}, {row.cells} x {row.cells}, {_listed(row.load)} N" for row in beyond)
    within = f"{len(rows) - len(beyond)} of {len(rows)} readings are within"
    counted = f"{within} twice the stated error plus three times the noise"
    return f"{counted}; beyond: {names}." if beyond else f"{counted}."


def write_page(rows: Sequence[DomeRow], pads: Sequence[PadRow], file: Path, command: str) -> None:
    """Write rows as a page that explains its columns.

    Parameters
    ----------
    rows : sequence of DomeRow
        Rows of the first table.
    pads : sequence of PadRow
        Rows of mirrors in other pads.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
    """
    table = markdown_table(HEADINGS, map(dome_cells, rows), HEADINGS[:2])
    pads_table = markdown_table(PAD_HEADINGS, map(pad_cells, pads), PAD_HEADINGS[:1])
    sizes = {"fine": FINE, "aside": FINE_ASIDE, "larger": LARGER, "smallest": SMALLEST}
    sizes["judge"] = Pad("hemispheric").default_mesh_size
    text = _PAGE.format(command=command, summary=summary(rows), table=table, pads=pads_table, **sizes)
    write_text(file, text)
