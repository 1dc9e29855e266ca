"""What a mould asks of a pad: thick walls, tapered cells, no tight bends."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mitsuba_taxel.pads.pad import PROFILE, Pad
from mitsuba_taxel.pads.profile import roof_of, side_of

PLACES = 33
"""Points of a roof that are looked at."""
FLAT = 50.0
"""Radius of curvature, relative to the size of a cell, that stands for flat."""


def thicknesses(pad: Pad) -> np.ndarray:
    """Thicknesses in mm: around the outer cells, above all cells, and between neighbours."""
    between = [pad.pitch - pad.cell_size] if pad.rows * pad.columns > 1 else []
    return np.array([pad.wall, pad.height - pad.top_of_cell, *between])


def draft_angles(pad: Pad) -> np.ndarray:
    """Degrees by which the wall of a cell leans inwards from the vertical, on its side and along its roof; negative
    where the cell is wider above."""
    if pad.cell != PROFILE:
        return np.zeros(1)
    along = np.concatenate([side_of(pad).at(np.zeros(1))[1], roof_of(pad).at(np.linspace(0, 1, PLACES))[1]])
    inwards, up = along.T * [[1], [-1]]
    return np.degrees(np.arctan2(inwards, up))


def bend_radii(pad: Pad) -> np.ndarray:
    """Radii of curvature of the roof along its meridian, in mm; its rim, which may be sharp, does not count."""
    if pad.cell != PROFILE:
        return np.array([pad.dome_radius] if pad.dome_radius else [])
    _, along, bend = roof_of(pad).at(np.linspace(0, 1, PLACES))
    curvature = (along[:, 0] * bend[:, 1] - along[:, 1] * bend[:, 0]) / np.linalg.norm(along, axis=1) ** 3
    return 1 / np.hypot(curvature, 1 / (FLAT * pad.cell_size))


def view_angles(pad: Pad) -> np.ndarray:
    """Degrees between the roof of a profile, along its meridian, and rays to it from the middle of the cell's opening;
    above 0 of all that can be made."""
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
