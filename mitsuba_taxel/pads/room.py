"""Test whether packages fit into the cells of undeformed parametric pads."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.pads.parametric.pad import Pad

ROUNDING = 1e-5
"""Relative error of lengths in single precision."""
WIDEST = 10.0
"""Largest width of a cell that is tried for a package, relative to the width of the package."""
_BISECTIONS = 20


def nearest_cell(pad: Pad, points: np.ndarray) -> np.ndarray:
    """Index (N,) of the cell nearest to each point (N, 2) on the pad's bottom.

    Parameters
    ----------
    pad : Pad
        The pad, with lengths in mm.
    points : (N, 2) ndarray
        x and y on the pad's bottom, mm.

    Returns
    -------
    (N,) ndarray of int
        Indices of the cells from 0, row by row.
    """
    last_index = np.array([pad.columns - 1, pad.rows - 1])
    column, row = np.clip(np.round(points / pad.pitch * [1, -1] + last_index / 2), 0, last_index).astype(int).T
    return row * pad.columns + column


def holds(pad: Pad, points: np.ndarray) -> np.ndarray:
    """Mask of the packages that lie entirely inside the hollow of a cell.

    Parameters
    ----------
    pad : Pad
        The pad, with lengths in mm.
    points : (N, M, 3) ndarray
        M points of each body, relative to the centre of the cell's opening, mm.

    Returns
    -------
    (N,) ndarray of bool
        Whether all points of a body lie within.
    """
    slack = ROUNDING * pad.cell_size
    points = points - points[..., 2:] * [*pad.slope, 0.0]
    within = pad.shape.holds(points, slack)
    if pad.edges is not None:
        within &= pad.edges.holds(points, slack)
    return np.all(within, axis=1)


def room_needed(pad: Pad, corners: np.ndarray) -> str:
    """Text for a message: the width that cells need so that a package at its position fits into one.

    Parameters
    ----------
    pad : Pad
        The pad, with lengths in mm.
    corners : (M, 3) ndarray
        Corners of the package in the frame of the pad, in mm.

    Returns
    -------
    str
        The smallest width, found by bisection, or a statement that cells of this height are too low at any width.
    """
    low, high = corners.min(axis=0), corners.max(axis=0)
    number = nearest_cell(pad, 0.5 * (low + high)[None, :2])[0]
    points = (corners - [*pad.cell_centres[number], 0.0])[None]
    width = 2 * float(np.abs(points[..., :2]).max())

    def fits(cell_size: float) -> bool:
        room = {"pitch": 4 * cell_size, "wall": cell_size, "height": 4 * cell_size + pad.height, "meshed_as": ""}
        try:
            return bool(holds(pad.changed(rows=1, columns=1, cell_size=cell_size, **room), points)[0])
        except InputError:  # a roof that is wider than it is high
            return False

    sizes = [size for size in np.geomspace(width, WIDEST * width, 64).tolist() if fits(size)]
    if not sizes:
        return f"its cells, {pad.top_of_cell:.3g} mm high, are too low for a package of {high[2]:.3g} mm"
    too_narrow, wide_enough = max(width * (1 - 1e-6), sizes[0] / WIDEST ** (1 / 63)), sizes[0]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (too_narrow + wide_enough)
        too_narrow, wide_enough = (too_narrow, middle) if fits(middle) else (middle, wide_enough)
    rounded = np.ceil(wide_enough * 100 * (1 - 1e-9)) / 100
    size = f"{high[0] - low[0]:.3g} x {high[1] - low[1]:.3g} mm"
    return f"a package of {size} needs cells at least {rounded:g} mm wide there"
