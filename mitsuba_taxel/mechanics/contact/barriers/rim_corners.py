"""Corners of the outer rims of an undeformed pad: where its outside meets the glued bottom, and the top."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.singular_edges import shared_edges
from mitsuba_taxel.pads.regions import REGIONS

ALMOST = 5.0
"""Degrees within which an angle counts as right."""


def rim_corners(mesh: VolumeMesh, region: str, least_turn: float) -> np.ndarray:
    """(k,) nodes at which the rim between a region and the outside turns by an angle in degrees or more."""
    edges, faces = shared_edges(mesh)
    regions = np.sort(mesh.face_region[faces], axis=1)
    rim = edges[(regions == sorted((REGIONS[region], REGIONS["outer"]))).all(axis=1), :2]
    ends, away = rim.ravel(), np.diff(mesh.points[rim], axis=1)[:, 0]
    away = np.stack([away, -away], axis=1).reshape(-1, 3) / np.linalg.norm(away, axis=1).repeat(2)[:, None]
    total = np.zeros((len(mesh.points), 3))
    np.add.at(total, ends, away)  # of two unit vectors, 2 sin(turn / 2) long
    return np.flatnonzero(np.linalg.norm(total, axis=1) > 2 * np.sin(np.deg2rad(least_turn / 2)))


def has_right_angled_top(mesh: VolumeMesh) -> bool:
    """Whether two upright sides meet each other and the top in a right angle, or a sharper one, somewhere."""
    sides = mesh.faces[mesh.face_region == REGIONS["outer"], :3]
    a, b, c = np.moveaxis(mesh.points[sides], 1, 0)
    normal = np.cross(b - a, c - a)
    leaning = np.abs(normal[:, 2]) > np.sin(np.deg2rad(ALMOST)) * np.linalg.norm(normal, axis=1)
    return bool((~np.isin(rim_corners(mesh, "top", 90 - ALMOST), sides[leaning])).any())
