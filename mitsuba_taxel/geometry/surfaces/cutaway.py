"""Closed surfaces cut by a plane, and capped there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.geometry.surfaces.polygons import triangulated
from mitsuba_taxel.geometry.surfaces.triangles import half_edges

NUDGE = 1e-4
"""Largest shift of the plane, relative to the extent of the surface. Planes of symmetry contain edges of many meshes,
and rounding in single precision would leave tiny triangles along them."""


@dataclass(frozen=True, eq=False)
class Half:
    """The part of a surface on one side of a cut.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray
        Vertex numbers, counter-clockwise seen from outside.
    source : (T,) ndarray
        Number of the triangle of the original surface that contains each triangle, -1 on the cap.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    source: np.ndarray


def is_closed(triangles: np.ndarray) -> bool:
    """Whether triangles form a closed surface: each edge occurs equally often in both directions.

    Parameters
    ----------
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Returns
    -------
    bool
        Whether their surface is closed.
    """
    edges, _ = half_edges(triangles)
    keys = edges.astype(np.int64) @ [int(triangles.max(initial=0)) + 1, 1]
    reversed_keys = edges[:, ::-1].astype(np.int64) @ [int(triangles.max(initial=0)) + 1, 1]
    return bool(np.array_equal(np.sort(keys), np.sort(reversed_keys)))


def cut_open(vertices: np.ndarray, triangles: np.ndarray, normal: np.ndarray, offset: float) -> Half:
    """The part of a surface where ``normal @ x > offset``; a closed surface stays closed, by a flat cap.

    The plane is shifted by at most :data:`NUDGE` of the surface's extent, away from vertices. The cap consists of the
    polygons in which the plane meets the surface, and shares their vertices. A surface with holes is left open.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray
        Counter-clockwise seen from outside if the surface is closed.
    normal : (3,) ndarray
        Normal of length 1.
    offset : float
        Offset of the plane from the origin, mm.

    Returns
    -------
    Half
        Vertices and triangles, including those of the cap.
    """
    height = vertices @ normal - offset
    height = height - _clear_of(height, NUDGE * np.ptp(vertices, axis=0).max(initial=0.0))
    above = height > 0
    crossed = np.flatnonzero(np.isin(above[triangles].sum(axis=1), (1, 2)))
    # Corners are rotated so that the first is alone on its side.
    inside = above[triangles[crossed]]
    alone = np.argmax(inside == (inside.sum(axis=1) == 1)[:, None], axis=1)
    a, b, c = (np.take_along_axis(triangles[crossed], (alone[:, None] + k) % 3, axis=1)[:, 0] for k in range(3))
    keys = np.sort(np.concatenate([np.stack([a, b], axis=1), np.stack([c, a], axis=1)]), axis=1)
    edges, number = np.unique(keys, axis=0, return_inverse=True)
    low, high = (height[edges[:, k], None] for k in (0, 1))
    points = (high * vertices[edges[:, 0]] - low * vertices[edges[:, 1]]) / (high - low)
    ab, ca = len(vertices) + number.reshape(2, -1)
    tip = above[a]
    uncut = np.flatnonzero(above[triangles].all(axis=1))
    pieces = [
        (triangles[uncut], uncut),
        (np.stack([a, ab, ca], axis=1)[tip], crossed[tip]),
        (np.stack([ab, b, c], axis=1)[~tip], crossed[~tip]),
        (np.stack([ab, c, ca], axis=1)[~tip], crossed[~tip]),
    ]
    if len(points) and is_closed(triangles):
        rim = np.where(tip[:, None], np.stack([ca, ab], axis=1), np.stack([ab, ca], axis=1)) - len(vertices)
        face = triangulated(points @ _plane_axes(normal), rim, strict=False) + len(vertices)
        pieces.append((face, np.full(len(face), -1)))
    kept, sources = (np.concatenate(column) for column in zip(*pieces, strict=True))
    used, kept = np.unique(kept, return_inverse=True)
    return Half(np.concatenate([vertices, points])[used], kept.reshape(-1, 3), sources)


def _clear_of(height: np.ndarray, reach: float) -> float:
    """Shift of a plane, between 0 and ``reach``, at which the plane is farthest from the nearest vertex."""
    candidates = height[(height > -reach) & (height < 2 * reach)]
    shifts = reach * np.linspace(0, 1, 17)
    gaps = [np.abs(candidates - shift).min(initial=np.inf) for shift in shifts]
    return float(shifts[np.argmax(gaps)])


def _plane_axes(normal: np.ndarray) -> np.ndarray:
    """Two orthogonal unit vectors in a plane, as columns (3, 2); with the opposite of ``normal`` they form a
    right-handed frame."""
    first = np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(first, normal)], axis=1)
