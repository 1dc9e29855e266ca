"""What a mould asks of a pad: thick walls, tapered cells, no tight bends."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mitsuba_taxel.pads.pad import PROFILE, Pad
from mitsuba_taxel.pads.profile import roof_of, side_of

PLACES = 33
"""Points of a roof that are looked at."""
SIDES = (1, -1)
"""Of a cell, that to which it leans first."""
FLAT = 50.0
"""Radius of curvature, relative to the size of a cell, that stands for flat."""


def thicknesses(pad: Pad) -> np.ndarray:
    """Thicknesses in mm: around the outer cells, above all cells, and between neighbours."""
    between = [pad.pitch - pad.cell_size] if pad.rows * pad.columns > 1 else []
    return np.array([pad.thinnest_wall, pad.height - pad.top_of_cell, *between])


def draft_angles(pad: Pad) -> np.ndarray:
    """Degrees by which the wall of a cell leans inwards from the vertical, on its side and along its roof; negative
    where the cell is wider above. Of leaning cells, where that is least around the axis."""
    if pad.cell == PROFILE:
        along = np.concatenate([side_of(pad).at(np.zeros(1))[1], roof_of(pad).at(np.linspace(0, 1, PLACES))[1]])
    else:
        along = np.array([[0.0, -1.0]])
    slope = max(map(abs, pad.slope)) if pad.is_square else math.hypot(*pad.slope)
    inwards, down = np.stack([_leaning(along, side * slope) for side in SIDES], axis=-1).swapaxes(0, 1)
    return np.degrees(np.arctan2(inwards, -down).min(axis=1))


def bend_radii(pad: Pad) -> np.ndarray:
    """Radii of curvature of the roof along its meridian, in mm; its rim, which may be sharp, does not count.

    Of leaning cells, the least of those across and along the plane in which they lean; of domes, one.
    """
    slope = math.hypot(*pad.slope)
    if pad.cell != PROFILE and not (pad.dome_radius and slope):
        return np.array([pad.dome_radius] if pad.dome_radius else [])
    _, along, bend = roof_of(pad.as_profile()).at(np.linspace(0, 1, PLACES))
    turn = along[:, 0] * bend[:, 1] - along[:, 1] * bend[:, 0]  # the same on all sides, as a shear keeps areas
    length = np.min([np.linalg.norm(_leaning(along, side * slope), axis=1) for side in (0, *SIDES)], axis=0)
    radii = 1 / np.hypot(turn / length**3, 1 / (FLAT * pad.cell_size))
    return radii if pad.cell == PROFILE else radii.min(keepdims=True)


def _leaning(along: np.ndarray, slope: float) -> np.ndarray:
    """Tangents (N, 2) of a meridian in a plane in which its cell leans outwards."""
    return along + along[:, 1:] * [slope, 0.0]


def view_angles(pad: Pad) -> np.ndarray:
    """Degrees between the roof of a profile, along its meridian, and rays to it from the middle of the cell's opening;
    above 0 of all that can be made. It is that of the upright cell, as a shear turns no roof away."""
    if pad.cell != PROFILE:
        return np.zeros(0)
    place, along, _ = roof_of(pad).at(np.linspace(0, 1, PLACES)[1:])
    turned = along[:, 0] * place[:, 1] - along[:, 1] * place[:, 0]
    return np.degrees(np.arctan2(turned, np.abs((along * place).sum(axis=1))))


SHAPE: dict[str, Callable[[Pad], np.ndarray]] = {
    "least_wall": thicknesses,
    "draft_angle": draft_angles,
    "least_radius": bend_radii,
    "view_angle": view_angles,
}
"""Figures of the shape of a pad alone, by name."""
