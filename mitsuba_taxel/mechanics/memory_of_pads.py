"""Memory needed to solve a large pad, estimated before meshing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.mirror import MIRRORS
from mitsuba_taxel.geometry.unique_rows import unique_rows
from mitsuba_taxel.mechanics.elements.loads import Load, PlateWrench, mirrored_value
from mitsuba_taxel.mechanics.elements.memory import free_memory
from mitsuba_taxel.mechanics.meshes import is_meshed, pad_mesh
from mitsuba_taxel.pads.any_pad import AnyPad
from mitsuba_taxel.pads.parametric.meshing import check_room
from mitsuba_taxel.pads.parametric.pad import Pad

BYTES = 11e3
"""Memory of a solution for each unknown: 4 to 5 kB for the factor in single precision, as much for its analysis, and
the matrix. The least measured value is used, so that no pad is refused that would fit: 10.6 to 17.5 kB with 30 000 to
236 000 unknowns (6 x 6 and 12 x 12 cells, with the second mesh)."""
UNKNOWNS = 7000
"""Unknowns for each cell of a pad of 3 x 3 parallelepiped cells with elements of the default size."""
BLOCK = 4
"""Number of rows and columns of the smaller pad whose unknowns are counted."""
INNER = 0.95
"""Unknowns per cell of a larger pad, relative to the smaller pad, where edges count more: from 0.88 to 0.99 with 5 x 5,
6 x 6, 9 x 9, 4 x 7, 8 x 1 and 2 x 9 cells of four shapes."""
FINEST = 0.5
"""Element size of the smaller pad, relative to the default; for smaller elements, their number is extrapolated."""
SURELY = 0.25
"""Fraction of the free memory up to which the estimate from `UNKNOWNS` suffices."""


def refuse_too_large(
    pad: AnyPad, mesh_size: float, load: Load, values: Iterable[Sequence[float] | np.ndarray] | None = None
) -> None:
    """Refuse a pad whose solution does not fit into the free memory, before it is meshed.

    The number of unknowns is extrapolated, with an error of 15 %, from a pad of at most 4 x 4 cells, which is meshed.
    The load is assumed to be symmetric if it may be. A pad that has been meshed before is not refused, as its solution
    may exist already.

    Parameters
    ----------
    pad : AnyPad
        The pad; a pad from a file is never refused.
    mesh_size : float
        Size of the elements in mm.
    load : Load
        Kind of load.
    values : iterable of sequence of float, optional
        Values of the load in N, mm or MPa; by default, without lateral components.

    Raises
    ------
    InputError
        if the mesh has more elements than are allowed.
    ComputationError
        if it does not fit; the message states a number of cells and an element size that would fit.
    """
    rows = np.atleast_2d(np.array([(0.0, 0.0, -1.0)] if values is None else [*values], dtype=float))
    loaded = rows[rows.any(axis=1)]
    if not isinstance(pad, Pad) or not len(loaded) or is_meshed(pad, mesh_size):
        return
    check_room(pad, mesh_size)
    cells, free = pad.rows * pad.columns, free_memory()
    # Symmetry depends on the directions of the loads only, of which a long path has few.
    directions = np.round(loaded / np.abs(loaded).max(axis=1, keepdims=True), 12)
    parts = min(symmetric_parts(pad, load, value) for value in directions[unique_rows(directions)[0]])
    guess = UNKNOWNS * max(1.0, pad.default_mesh_size / mesh_size) ** 3
    if BYTES * guess * cells / parts < SURELY * free:
        return
    counted_at = max(mesh_size, FINEST * pad.default_mesh_size)
    # Meshing such a pad is as fast as estimating it.
    if max(pad.rows, pad.columns) <= BLOCK and counted_at == mesh_size:
        return
    block = replace(pad, rows=min(pad.rows, BLOCK), columns=min(pad.columns, BLOCK))
    share = cells / (block.rows * block.columns) * (counted_at / mesh_size) ** 3 * (1.0 if block == pad else INNER)
    mesh = pad_mesh(block, counted_at)
    above = int(np.count_nonzero(mesh.points[:, 2] > mesh.points[:, 2].min()))
    needed = BYTES * (3 * above + mesh.corner_count) * share / parts
    if needed <= free:
        return
    shown, remedies = f"{pad.rows} x {pad.columns} cells with elements of {mesh_size:.3g} mm", []
    if cells > 1:
        scale = math.sqrt(free / needed)
        remedies.append(f"rows = {max(1, int(scale * pad.rows))}, columns = {max(1, int(scale * pad.columns))}")
    larger = mesh_size * (needed / free) ** (1 / 3)
    if larger <= pad.default_mesh_size:
        remedies.append(f"mesh_size = {math.ceil(100 * larger) / 100:g}")
    raise ComputationError(
        f"there is not enough memory for {shown}: some {needed / 1e9:.3g} GB are needed and {free / 1e9:.2g} GB are "
        f"free. {' or '.join(remedies)} would fit."
    )


def symmetric_parts(pad: Pad, load: Load, value: Sequence[float] | np.ndarray) -> int:
    """Number of equal parts into which mirrors divide a pad under a load; only one of them must be solved.

    Parameters
    ----------
    pad : Pad
        The pad.
    load : Load
        Kind of load.
    value : sequence of float
        Value of the load in N, mm or MPa.

    Returns
    -------
    int
        Number of images: 8 for a square pad and 4 for another pad under a central load without lateral components; 2 if
        the load is off the centre along an axis or diagonal, or leans along one; else 1.
    """
    is_square = pad.rows == pad.columns
    if isinstance(load, PlateWrench):
        point, value = np.array([load.x, load.y, 0.0]), np.asarray(value, dtype=float)
        mirrors = MIRRORS if is_square else MIRRORS[:2]
        kept = [m for m in mirrors if m.side(point) == 0 and np.array_equal(mirrored_value(m, value), value)]
        return {0: 1, 1: 2, 2: 4, 4: 8}[len(kept)]
    sideways = [(value[0], value[1])] if len(value) > 1 else []
    position = getattr(load.indenter or load, "at", None)
    for x, y in [*sideways, *([] if position is None else [position])]:
        if x and y and not (is_square and abs(x) == abs(y)):
            return 1
        if x or y:
            return 2
    return 8 if is_square else 4
