"""The feet of a pad's upright outer edges, where two free sides meet the glued bottom.

There the volume ratio of any law for large strains falls without limit as elements become smaller: the foot rolls over
onto the board, and the path of a pad that goes on would end by its elements. A linear law has no such limit.
"""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.singular_edges import shared_edges
from mitsuba_taxel.mechanics.elements.elements import quadrature_places
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.pads.pad import REGIONS

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
    """(m, q) whether the quadrature points of the elements are within :data:`RADIUS` of a foot."""
    places, radius = quadrature_places(mesh), RADIUS * float(np.ptp(mesh.points[:, 2]))
    near = np.zeros(places.shape[:2], dtype=bool)
    for foot in _feet(mesh):
        near |= np.linalg.norm(places - foot, axis=-1) < radius
    return near


def _feet(mesh: VolumeMesh) -> np.ndarray:
    """(k, 3) mm, corners of the undeformed rim between bottom and outside."""
    edges, faces = shared_edges(mesh)
    regions = np.sort(mesh.face_region[faces], axis=1)
    rim = edges[(regions == sorted((REGIONS["bottom"], REGIONS["outer"]))).all(axis=1), :2]
    ends, away = rim.ravel(), np.diff(mesh.points[rim], axis=1)[:, 0]
    away = np.stack([away, -away], axis=1).reshape(-1, 3) / np.linalg.norm(away, axis=1).repeat(2)[:, None]
    total = np.zeros((len(mesh.points), 3))
    np.add.at(total, ends, away)  # of two unit vectors, 2 sin(turn / 2) long
    sharp = np.linalg.norm(total, axis=1) > 2 * np.sin(np.deg2rad(SHARP / 2))
    return mesh.points[sharp]
