"""Domes compared with independent references: the sphere, and loaded ones on much smaller elements."""

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
from mitsuba_taxel.evidence.coverage.sphere_light import DOMES, SPACING
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.cells.cell_shape import CellShape, LightSizes
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
"""Cells along a side of the pad, and force on each cell in N."""
FINE = {1: 0.25, 3: 0.4}
"""Mesh size in mm of the truth of domes under normal forces, by cells along a side."""
FINE_ASIDE = {1: 0.3, 3: 0.4}
"""The same under tangential ones, for which half the pad is solved, not an eighth; of 3 x 3 cells that takes too much
memory, and their truth is judged on the default elements and solved by parts of the pad, as readings are."""
PADS: tuple[tuple[float, dict[str, float]], ...] = (
    (-1.0, {}),
    (-2.0, {}),
    (-2.0, {"cell_size": 3.2, "pitch": 4.3, "height": 5.2, "wall": 0.9}),
    (-1.0, {"wall": 0.7, "height": 4.2}),
    (-2.5, {"cell_size": 2.2, "wall": 1.2}),
    (-1.2, {"youngs_modulus": 2.0}),
)
"""Pads of one hemispheric mirror: force in N, and what differs from the default, in mm and MPa."""
LARGER, SMALLEST = 1.25, 0.3
"""Mesh sizes in mm of these pads, beside the default, and of their truth."""
POINTS, RAYS = 1 << 13, 1 << 19
"""Points per replicate, of all taxels of a mirror together; and of each of the 16 runs of rays on a sphere."""
MORE_POINTS = {("spherical", "rough mirror"): 16}
"""Times as many, where few paths carry the light."""

PAD_HEADINGS = ("pad", "load [N]", "truth [W/W]", "deviation", "its noise", "stated", f"deviation, {LARGER:g} mm")
HEADINGS = ("cell", "roof", "cells", "N per cell", "truth [W/W]", "deviation", "its noise", "stated for the shape")

_PAGE = """\
# Domes

Written by `{command}`; do not edit by hand.

Readings of domed cells at the default settings, compared with independent references. Unloaded domes are spheres: the
reference is a quadrature for diffuse walls, and ray tracing on the exact sphere for mirrors; neither uses elements,
triangles or a renderer (`mitsuba_taxel/evidence/coverage/sphere_light.py`). Loaded ones are compared with elements of
{fine[1]:g} mm (1 x 1 cells), {aside[1]:g} mm (those under tangential forces) or {fine[3]:g} mm (3 x 3), not of the
default 0.625 to 0.75 mm. Stability of 3 x 3 cells under tangential forces is judged on elements of {judge:g} mm in
both.

{table}

- **deviation**: of the mean of all taxels from the truth, relative; **its noise**: one standard error, of both.
- **stated for the shape**: relative error stated for the geometry and, under load, the mechanics.
- rough mirror: root-mean-square slope of 2 degrees.

## Mirrors of other pads
One hemispheric cell on elements of the default size, and of {larger:g} mm, compared with elements of {smallest:g} mm.

{pads}
"""


@dataclass(frozen=True)
class DomeRow:
    """One row; `off`, `noise` and `stated` are relative."""

    cell: str
    wall: str
    cells: int
    load: Force
    truth: float
    off: float
    noise: float
    stated: float


@dataclass(frozen=True)
class PadRow:
    """One row of the mirrors of other pads; all but `pad`, `load` and `truth` are relative."""

    pad: str
    load: float
    truth: float
    off: float
    noise: float
    stated: float
    off_larger: float


def dome_scene(cell: str, roof: dict[str, Any], cells: int = 1, **pad: Any) -> Scene:
    """Domes over LEDs without a hole, of which only the roof does not absorb."""
    walls = {"type": "region", "roof": {"type": "wall", **roof}}
    reflector = {"type": "photo_reflector", "rows": cells, "columns": cells, "spacing": SPACING}
    reflector |= {"led": {"type": "annular_led", "hole": 0.0}, "detector": {"type": "phototransistor"}}
    pad = {"type": "deformable_pad", "cell": cell, "rows": cells, "columns": cells, "walls": walls, **pad}
    return Scene({"type": "scene", "integrator": {"type": "taxel_tracer"}, "pad": pad, "packages": reflector})


def domes(starting: Callable[[str], None] | None = None) -> Iterator[DomeRow]:
    """Rows of the table as they are measured; ``starting`` is called with the name of each."""
    for cell in DOMES:
        for name in WALLS:
            sphere = None
            for cells, load in CASES:
                if starting:
                    starting(f"{cell}, {name}, {cells} x {cells}, {_listed(load)} N per cell")
                sphere = sphere or _on_sphere(cell, name)
                truth = _on_small_elements(cell, name, cells, load) if any(load) else sphere
                yield _row(cell, name, cells, load, truth)


def mirrors_of_pads(starting: Callable[[str], None] | None = None) -> Iterator[PadRow]:
    """Rows of the mirrors of other pads as they are measured; ``starting`` is called with the name of each."""
    for load, changed in PADS:
        pad = ", ".join(f"{name} = {value:g}" for name, value in changed.items()) or "default"
        if starting:
            starting(f"hemispheric, mirror, {pad}, {load:g} N")
        about: dict[str, Any] = {"force": [0, 0, load], **changed}
        default = measure(dome_scene("hemispheric", WALLS["mirror"], **about), points=POINTS, seed=1)
        larger, truth = (
            measure(
                dome_scene("hemispheric", WALLS["mirror"], mesh_size=size, **about),
                points=POINTS,
                seed=2,
                mechanics_error=False,
            )
            for size in (LARGER, SMALLEST)
        )
        (power, error), (value, uncertain) = _mean(default), _mean(truth)
        noise, stated = math.hypot(error, uncertain) / value, stated_for_shape(default)
        yield PadRow(pad, load, value, power / value - 1, noise, stated, _mean(larger)[0] / value - 1)


def stated_for_shape(readings: Readings) -> float:
    """Relative error that readings state for geometry and mechanics."""
    return math.hypot(readings.error_budget["geometry"], readings.error_budget["mechanics"])


def _row(cell: str, name: str, cells: int, load: Force, truth: tuple[float, float]) -> DomeRow:
    scene = dome_scene(cell, WALLS[name], cells, force=_on_pad(load, cells))
    readings = measure(scene, points=_points(cell, name, cells), seed=1)
    power, error = _mean(readings)
    value, uncertain = truth
    noise = math.hypot(error, uncertain) / value
    return DomeRow(cell, name, cells, load, value, power / value - 1, noise, stated_for_shape(readings))


def _on_sphere(cell: str, name: str) -> tuple[float, float]:
    """Power on the phototransistor in W, and its standard error."""
    wall = WALLS[name]
    if "mirror" in name:
        return DOMES[cell].mirror_power(wall.get("rms_slope", 0.0), seed=1, points=RAYS)
    return DOMES[cell].diffuse_power(wall["scattering"], 24), 0.0


def _on_small_elements(cell: str, name: str, cells: int, load: Force) -> tuple[float, float]:
    size = (FINE_ASIDE if any(load[:2]) else FINE)[cells]
    by_parts = cells > 1 and any(load[:2])
    given = {} if by_parts else {"mesh_size": size}
    scene = dome_scene(cell, WALLS[name], cells, force=_on_pad(load, cells), **given)
    with _default_elements(cell, size) if by_parts else nullcontext():
        return _mean(measure(scene, points=_points(cell, name, cells), seed=2, mechanics_error=False))


@contextmanager
def _default_elements(cell: str, size: float) -> Iterator[None]:
    """While it lasts, loaded domes have elements of a ``size`` in mm by default."""
    relative = size / Pad(cell).default_mesh_size
    shape = CellShape.named(cell)
    usual = shape.light_sizes
    try:
        shape.light_sizes = LightSizes(diffuse=relative, mirrors=relative, mirrors_side_by_side=relative)
        yield
    finally:
        shape.light_sizes = usual


def _on_pad(load: Force, cells: int) -> list[float]:
    """In N, the force on all cells."""
    return [component * cells**2 for component in load]


def _listed(load: Force) -> str:
    """A force, by its normal component alone where that is all."""
    return ", ".join(f"{component:g}" for component in (load if any(load[:2]) else load[2:]))


def _points(cell: str, name: str, cells: int) -> int | None:
    """Points per replicate and taxel; None for diffuse walls, which need no random paths."""
    return MORE_POINTS.get((cell, name), 1) * POINTS // cells**2 if "mirror" in name else None


def _mean(readings: Readings) -> tuple[float, float]:
    """Mean power of all equal taxels, and its standard error."""
    means = readings.replicates.mean(axis=1)
    return float(means.mean()), float(np.std(means, ddof=1) / math.sqrt(len(means)))


def dome_cells(row: DomeRow) -> list[str]:
    """The row as text, below `HEADINGS`."""
    off, noise, stated = f"{row.off:+.3%}", f"{row.noise:.3%}", f"{row.stated:.3%}"
    return [row.cell, row.wall, f"{row.cells} x {row.cells}", _listed(row.load), f"{row.truth:.6g}", off, noise, stated]


def pad_cells(row: PadRow) -> list[str]:
    """The row as text, below `PAD_HEADINGS`."""
    relative = f"{row.off:+.2%}", f"{row.noise:.2%}", f"{row.stated:.2%}", f"{row.off_larger:+.2%}"
    return [row.pad, f"{row.load:g}", f"{row.truth:.6g}", *relative]


def write_page(rows: Sequence[DomeRow], pads: Sequence[PadRow], file: Path, command: str) -> None:
    """Write the rows as a page with an explanation of its columns."""
    table = markdown_table(HEADINGS, map(dome_cells, rows), HEADINGS[:2])
    others = markdown_table(PAD_HEADINGS, map(pad_cells, pads), PAD_HEADINGS[:1])
    sizes = {"fine": FINE, "aside": FINE_ASIDE, "larger": LARGER, "smallest": SMALLEST}
    sizes["judge"] = Pad("hemispheric").default_mesh_size
    text = _PAGE.format(command=command, table=table, pads=others, **sizes)
    write_text(file, text)
