"""Properties of a pad's shape that casting limits: thickness of walls, taper of cells, and radii of bends."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mitsuba_taxel.pads.cells.meridian import SIDES, leaning
from mitsuba_taxel.pads.parametric.pad import Pad


def thicknesses(pad: Pad) -> np.ndarray:
    """Thicknesses of the silicone in mm: around the outer cells, above all cells, and between neighbouring cells."""
    between = [pad.pitch - pad.cell_size] if pad.rows * pad.columns > 1 else []
    return np.array([pad.thinnest_wall, pad.height - pad.top_of_cell, *between])


def draft_angles(pad: Pad) -> np.ndarray:
    """Draft angles of the wall of a cell, in degrees from the vertical: of its side, then along its roof.

    An angle is positive where the cell narrows upwards, so that the mould can be pulled out, and negative where it
    widens. Where cells lean, it is the smallest angle around the axis."""
    shape = pad.shape
    slope = max(map(abs, pad.slope)) if shape.is_square else math.hypot(*pad.slope)
    inwards, down = np.stack([leaning(shape.wall_tangents(), side * slope) for side in SIDES], axis=-1).swapaxes(0, 1)
    return np.degrees(np.arctan2(inwards, -down).min(axis=1))


def bend_radii(pad: Pad) -> np.ndarray:
    """Radii of curvature of the roof along its meridian, in mm. The rim, which may be sharp, is left out.

    Where cells lean, the result is the smaller of the radii across and along the plane in which they lean. A dome has a
    single radius.
    """
    return pad.shape.bend_radii()


def view_angles(pad: Pad) -> np.ndarray:
    """Angles in degrees between the meridian of a roof and the rays to it from the middle of the cell's opening.

    They are positive for every pad that can be made. They are computed for the upright cell: a shear changes no sign.
    """
    return pad.shape.view_angles()


SHAPE: dict[str, Callable[[Pad], np.ndarray]] = {
    "least_wall": thicknesses,
    "draft_angle": draft_angles,
    "least_radius": bend_radii,
    "view_angle": view_angles,
}
"""Figures that depend on the shape of a pad only, by name."""
