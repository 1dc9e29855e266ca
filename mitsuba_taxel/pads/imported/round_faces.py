"""Nodes put onto the spheres and upright cylinders that faces of a body are, found from the nodes on them."""

from __future__ import annotations

import numpy as np

ROUNDING = 1e-6
"""Distance from a sphere or cylinder, relative to its radius, that is rounding."""


def on_round_faces(
    known: np.ndarray,
    known_faces: np.ndarray,
    known_face: np.ndarray,
    points: np.ndarray,
    faces: np.ndarray,
    face: np.ndarray,
) -> np.ndarray:
    """Nodes (N, 3), those on round faces of a body put exactly onto them.

    ``known`` (K, 3) are nodes of a mesh that lie on the surface of the body, ``known_faces`` (A, 6) its boundary
    triangles, and ``known_face`` (A,) the face of the body that each follows; ``faces`` (B, 6) and ``face`` (B,) those
    of the mesh of the nodes that are moved.
    """
    points = points.copy()
    for number in np.unique(face[face >= 0]):
        given = known[np.unique(known_faces[known_face == number])]
        own = np.unique(faces[face == number])
        for axes in (3, 2):
            centre, radius = _fitted(given[:, :axes])
            if abs(np.linalg.norm(given[:, :axes] - centre, axis=1) / radius - 1).max() < ROUNDING:
                outwards = points[own, :axes] - centre
                points[own, :axes] = centre + radius * outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
                break
    return points


def _fitted(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius of the sphere or circle that points (N, 3) or (N, 2) lie on, by least squares.

    From x.x = 2 c.x + r^2 - c.c, which is linear in c and the rest.
    """
    origin = points.mean(axis=0)
    moved = points - origin
    solution, *_ = np.linalg.lstsq(
        np.column_stack([2 * moved, np.ones(len(moved))]), (moved**2).sum(axis=1), rcond=None
    )
    centre = solution[:-1]
    return origin + centre, float(np.sqrt(max(solution[-1] + centre @ centre, 1e-300)))
