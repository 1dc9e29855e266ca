"""The feet of a pad's upright outer edges, where two free sides meet the glued bottom.

There the volume ratio of any law for large strains falls without limit as elements become smaller: the foot rolls over
onto the board, and the path of a pad that goes on would end by its elements. A linear law has no such limit.
"""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.rim_corners import rim_corners
from mitsuba_taxel.mechanics.elements.elements import quadrature_places
from mitsuba_taxel.mechanics.elements.loads import Load

RADIUS = 1 / 15
"""Distance from a foot, relative to the pad's height, within which the law of a pad that goes on is linear."""
SHARP = 30.0
"""Least turn of the glued outer rim at a foot, in degrees."""


def where_linear(mesh: VolumeMesh, load: Load) -> np.ndarray | None:
    """(m, q) whether the law is linear at the quadrature points of the elements.

    None if at none: under loads that do not go on where a pad touches itself or the board, and of round pads.
    """
    if not load.goes_on:
        return None
    near = near_feet(mesh)
    return near if near.any() else None


def near_feet(mesh: VolumeMesh) -> np.ndarray:
    """(m, q) whether the quadrature points of the elements are near a foot."""
    return are_at_feet(mesh, quadrature_places(mesh))


def are_at_feet(mesh: VolumeMesh, places: np.ndarray) -> np.ndarray:
    """(...) whether places (..., 3) in mm are within :data:`RADIUS` of a foot."""
    near, radius = np.zeros(places.shape[:-1], dtype=bool), RADIUS * float(np.ptp(mesh.points[:, 2]))
    for foot in mesh.points[rim_corners(mesh, "bottom", SHARP)]:
        near |= np.linalg.norm(places - foot, axis=-1) < radius
    return near
