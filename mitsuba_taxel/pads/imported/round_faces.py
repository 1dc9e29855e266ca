"""Projection of nodes onto spherical and upright cylindrical faces of a body, which are recognised from its mesh."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.surfaces.radial import put_radially
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.regions import REGIONS

ROUNDING = 1e-6
"""Distance from a sphere or cylinder, relative to its radius, attributed to rounding."""
FLATTEST = 100.0
"""Radius of a wall relative to its extent, above which it counts as flat: through points of a plane there are spheres
and cylinders of any radius above some 1e5 extents, onto which nodes are not projected but scattered."""


def on_round_faces(
    known: np.ndarray,
    known_faces: np.ndarray,
    known_face: np.ndarray,
    points: np.ndarray,
    faces: np.ndarray,
    face: np.ndarray,
) -> np.ndarray:
    """Nodes (N, 3), those on round faces of a body projected exactly onto them.

    ``known`` (K, 3) are nodes of a mesh that lie on the surface of the body, ``known_faces`` (A, 6) its boundary
    triangles, and ``known_face`` (A,) the face of the body that each follows; ``faces`` (B, 6) and ``face`` (B,) are
    those of the mesh whose nodes are moved.
    """
    points = points.copy()
    for number in np.unique(face[face >= 0]):
        given = known[np.unique(known_faces[known_face == number])]
        own = np.unique(faces[face == number])
        for axes in (3, 2):
            if (wall := _round(given, axes)) is not None:
                centre, radius = wall
                outwards = points[own, :axes] - centre
                points[own, :axes] = centre + radius * outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
                break
    return points


def onto_round_walls(
    mesh: VolumeMesh, points: np.ndarray, region: np.ndarray, cell: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Project points of roofs and sides radially onto the sphere or upright cylinder on which all nodes of the wall
    lie.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed, with its nodes on the walls.
    points : (N, 3) ndarray
        In mm, near the walls.
    region, cell : (N,) ndarray
        Code of the region and number of the cell of each.

    Returns
    -------
    places : (N, 3) ndarray
        In mm; points of other walls are unchanged.
    gradient : (N, 3, 3) ndarray
        Derivative of each projected point with respect to the point.
    """
    places, gradient = points.copy(), np.tile(np.eye(3), (len(points), 1, 1))
    for code, number, wall in round_walls(mesh):
        here = (region == code) & (cell == number)
        places[here], gradient[here] = put_radially(points[here], *wall)
    return places, gradient


@kept(4)  # the states of a path share their mesh
def round_walls(mesh: VolumeMesh) -> list[tuple[int, int, tuple[np.ndarray, float, np.ndarray]]]:
    """The round walls of a mesh: spheres and vertical cylinders.

    Parameters
    ----------
    mesh : VolumeMesh
        Of the undeformed pad.

    Returns
    -------
    list[tuple[int, int, tuple[ndarray, float, ndarray]]]
        Of each wall the code of its region, the number of its cell, and its centre (3,) and radius in mm with a matrix
        (3, 3) that keeps the directions across its axis.
    """
    found = []
    in_cell = np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"])) & (mesh.face_cell > 0)
    for code, number in np.unique(np.stack([mesh.face_region, mesh.face_cell])[:, in_cell], axis=1).T.tolist():
        faces = mesh.faces[(mesh.face_region == code) & (mesh.face_cell == number)]
        nodes = mesh.points[np.unique(faces)]
        for axes in (3, 2):
            if (wall := _round(nodes, axes)) is not None:
                found.append((code, number, (np.append(wall[0], 0.0)[:3], wall[1], np.diag(np.arange(3) < axes) * 1.0)))
                break
    return found


def _round(nodes: np.ndarray, axes: int) -> tuple[np.ndarray, float] | None:
    """Centre and radius of the sphere (3 axes) or upright cylinder (2) through nodes (N, 3); None if there is none."""
    centre, radius = _fitted(nodes[:, :axes])
    if radius > FLATTEST * np.linalg.norm(np.ptp(nodes[:, :axes], axis=0)):
        return None
    off = np.abs(np.linalg.norm(nodes[:, :axes] - centre, axis=1) / radius - 1).max()
    return (centre, radius) if off < ROUNDING else None


def _fitted(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius of the sphere or circle through points (N, 3) or (N, 2), by least squares.

    From x.x = 2 c.x + (r^2 - c.c), which is linear in c and the bracket.
    """
    origin = points.mean(axis=0)
    moved = points - origin
    solution, *_ = np.linalg.lstsq(
        np.column_stack([2 * moved, np.ones(len(moved))]), (moved**2).sum(axis=1), rcond=None
    )
    centre = solution[:-1]
    return origin + centre, float(np.sqrt(max(solution[-1] + centre @ centre, 1e-300)))
