"""Gaps between a pad and the packages that it rests on, which are closed for light.

The contact barrier keeps walls at about its reach from a package. A real pad has no such gap, and light would leak
through it.
"""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, closest_on_triangles, unit
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.barriers.body_barrier import BodyBarrier

SHUT = 2.0
"""Width of gaps that are closed, relative to the reach of the barrier: between the points in contact, the curved faces
of elements are up to one reach further from a flat package."""
LEAST = 0.25
"""Distance from a body to which closer points are moved, relative to the width of closed gaps: a pad that is displaced
by its estimated error may be closer, or inside the body."""
ALIKE = 1e-9
"""Tolerance in mm of distances from triangles that share the nearest point."""
POINTS_AT_ONCE = 4096


@kept(4)  # the states of a path share their mesh
def widest_shut(mesh: VolumeMesh, bodies: RigidBodies) -> float:
    """Width in mm of a gap between a pad and a body up to which the gap counts as closed, so that no light passes
    through it.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    bodies : RigidBodies
        Bodies that the pad may touch.

    Returns
    -------
    float
        Width in mm.
    """
    return SHUT * BodyBarrier(mesh, 1.0, bodies).reach


def kept_off(points: np.ndarray, bodies: RigidBodies, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Move points of a pad's surface that are too close to a body away from it. Returns all points, and a mask of the
    points that touch a body.

    Parameters
    ----------
    points : (V, 3) ndarray
        Positions in mm.
    bodies : RigidBodies
        Bodies that the pad may touch.
    width : float
        Distance below which a point touches a body, mm.

    Returns
    -------
    points : (V, 3) ndarray
        Positions in mm, at least :data:`LEAST` times the width away from each body.
    touches : (V,) ndarray of bool
        Whether each point touches a body.
    """
    vertices, triangles = bodies.surface
    corners, outwards = vertices[triangles], unit(area_normals(vertices, triangles))
    low, high = vertices.min(axis=0) - width, vertices.max(axis=0) + width
    candidates = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
    displaced, touches = points.copy(), np.zeros(len(points), dtype=bool)
    for start in range(0, len(candidates), POINTS_AT_ONCE):
        batch = candidates[start : start + POINTS_AT_ONCE]
        # The nearest point of the bodies. Of the triangles that share it, the one with the largest height of the point
        # above or below its plane decides the sign.
        nearest_points = closest_on_triangles(
            np.repeat(points[batch], len(corners), axis=0), np.tile(corners, (len(batch), 1, 1))
        )
        offsets = points[batch][:, None] - nearest_points.reshape(len(batch), -1, 3)
        distances, heights = np.linalg.norm(offsets, axis=2), np.einsum("pti,ti->pt", offsets, outwards)
        is_nearest = distances < distances.min(axis=1, keepdims=True) + ALIKE
        rows, nearest = np.arange(len(batch)), np.where(is_nearest, np.abs(heights), -1.0).argmax(axis=1)
        distance = np.copysign(distances[rows, nearest], heights[rows, nearest])
        # Move along the normal of the surface: at an edge or a corner, the direction from the nearest point.
        is_distant = np.abs(distance) > ALIKE
        direction = offsets[rows, nearest] / np.where(is_distant, distance, 1.0)[:, None]
        normal = np.where(is_distant[:, None], direction, outwards[nearest])
        displaced[batch] += np.maximum(LEAST * width - distance, 0.0)[:, None] * normal
        touches[batch] = distance < width
    return displaced, touches
