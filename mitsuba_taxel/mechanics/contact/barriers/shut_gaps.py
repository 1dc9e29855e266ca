"""Gaps between a pad and the packages that it rests on, which are shut for light.

The barrier of contact holds walls about its reach off a package. That gap is none of a real pad, and light would creep
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
"""Width of gaps that are shut, relative to the reach of the barrier: between the points that press, the curved faces of
elements stay off a flat package by up to as much again."""
LEAST = 0.25
"""Least distance from a body, relative to that width: of a pad that is displaced by its error, it is not kept."""
ALIKE = 1e-9
"""Difference in mm of distances from triangles that share the nearest point."""
POINTS_AT_ONCE = 4096


@kept(4)  # the states of a path share their mesh
def widest_shut(mesh: VolumeMesh, bodies: RigidBodies) -> float:
    """Width below which a gap between a pad and a body is shut.

    Parameters
    ----------
    mesh : VolumeMesh
        Of the undeformed pad.
    bodies : RigidBodies
        That it may touch.

    Returns
    -------
    float
        In mm.
    """
    return SHUT * BodyBarrier(mesh, 1.0, bodies).reach


def kept_off(places: np.ndarray, bodies: RigidBodies, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Points of a pad's surface, moved off bodies where they are within them, and whether each touches one.

    Parameters
    ----------
    places : (V, 3) ndarray
        In mm.
    bodies : RigidBodies
        That the pad may touch.
    width : float
        In mm, distance below which a point touches a body.

    Returns
    -------
    points : (V, 3) ndarray
        None of them closer than :data:`LEAST`, mm.
    touches : (V,) ndarray of bool
        Whether each point touches a body.
    """
    points, triangles = bodies.surface
    corners, outwards = points[triangles], unit(area_normals(points, triangles))
    low, high = points.min(axis=0) - width, points.max(axis=0) + width
    near = np.flatnonzero(((places > low) & (places < high)).all(axis=1))
    moved, touches = places.copy(), np.zeros(len(places), dtype=bool)
    for start in range(0, len(near), POINTS_AT_ONCE):
        some = near[start : start + POINTS_AT_ONCE]
        # The nearest point of the bodies; of the triangles that share it, that which the point is most above or below.
        feet = closest_on_triangles(np.repeat(places[some], len(corners), axis=0), np.tile(corners, (len(some), 1, 1)))
        ways = places[some][:, None] - feet.reshape(len(some), -1, 3)
        distances, heights = np.linalg.norm(ways, axis=2), np.einsum("pti,ti->pt", ways, outwards)
        shared = distances < distances.min(axis=1, keepdims=True) + ALIKE
        rows, nearest = np.arange(len(some)), np.where(shared, np.abs(heights), -1.0).argmax(axis=1)
        distance = np.copysign(distances[rows, nearest], heights[rows, nearest])
        # Along the normal of the surface: of an edge or a corner, that of the way from there.
        apart = np.abs(distance) > ALIKE
        away = ways[rows, nearest] / np.where(apart, distance, 1.0)[:, None]
        normal = np.where(apart[:, None], away, outwards[nearest])
        moved[some] += np.maximum(LEAST * width - distance, 0.0)[:, None] * normal
        touches[some] = distance < width
    return moved, touches
