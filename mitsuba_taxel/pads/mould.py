"""What a mould asks of a pad: thick walls, tapered cells, no tight bends."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mitsuba_taxel.pads.cells.meridian import SIDES, leaning
from mitsuba_taxel.pads.parametric.pad import Pad


def thicknesses(pad: Pad) -> np.ndarray:
    """Thicknesses in mm: around the outer cells, above all cells, and between neighbours."""
    between = [pad.pitch - pad.cell_size] if pad.rows * pad.columns > 1 else []
    return np.array([pad.thinnest_wall, pad.height - pad.top_of_cell, *between])


def draft_angles(pad: Pad) -> np.ndarray:
    """Degrees by which the wall of a cell leans inwards from the vertical, on its side and along its roof; negative
    where the cell is wider above. Of leaning cells, where that is least around the axis."""
    shape = pad.shape
    slope = max(map(abs, pad.slope)) if shape.is_square else math.hypot(*pad.slope)
    inwards, down = np.stack([leaning(shape.wall_tangents(), side * slope) for side in SIDES], axis=-1).swapaxes(0, 1)
    return np.degrees(np.arctan2(inwards, -down).min(axis=1))


def bend_radii(pad: Pad) -> np.ndarray:
    """Radii of curvature of the roof along its meridian, in mm; its rim, which may be sharp, does not count.

    Of leaning cells, the least of those across and along the plane in which they lean; of domes, one.
    """
    return pad.shape.bend_radii()


def view_angles(pad: Pad) -> np.ndarray:
    """Degrees between the roof of a profile, along its meridian, and rays to it from the middle of the cell's opening;
    above 0 of all that can be made. It is that of the upright cell, as a shear turns no roof away."""
    return pad.shape.view_angles()


SHAPE: dict[str, Callable[[Pad], np.ndarray]] = {
    "least_wall": thicknesses,
    "draft_angle": draft_angles,
    "least_radius": bend_radii,
    "view_angle": view_angles,
}
"""Figures of the shape of a pad alone, by name."""
