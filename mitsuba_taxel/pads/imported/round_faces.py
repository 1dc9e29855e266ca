"""Projection of nodes onto spherical and upright cylindrical faces of a body, recognised from its mesh."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.surfaces.radial import put_radially
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.regions import REGIONS

ROUNDING = 1e-6
"""Largest distance of nodes from a sphere or cylinder, relative to its radius, that rounding explains."""
FLATTEST = 100.0
"""Radius of a wall, relative to its extent, above which it counts as flat. Spheres and cylinders of any radius above
some 1e5 extents pass through the points of a plane; a projection onto them would scatter the nodes."""


def on_round_faces(
    surface_points: np.ndarray,
    surface_faces: np.ndarray,
    surface_face: np.ndarray,
    points: np.ndarray,
    faces: np.ndarray,
    face: np.ndarray,
) -> np.ndarray:
    """Project the nodes on round faces of a body exactly onto them.

    Parameters
    ----------
    surface_points : (K, 3) ndarray
        Nodes of a mesh on the surface of the body, mm.
    surface_faces, surface_face : (A, 6) and (A,) ndarray
        Nodes of the A boundary triangles of the body, and the face of the body that each follows.
    points : (N, 3) ndarray
        Nodes of the mesh to be corrected, mm.
    faces, face : (B, 6) and (B,) ndarray
        Nodes of the B boundary triangles of the mesh, and the face of the body that each follows.

    Returns
    -------
    (N, 3) ndarray
        The corrected nodes, mm.
    """
    points = points.copy()
    for number in np.unique(face[face >= 0]):
        wall_points = surface_points[np.unique(surface_faces[surface_face == number])]
        nodes = np.unique(faces[face == number])
        for axes in (3, 2):
            if (wall := _round(wall_points, axes)) is not None:
                centre, radius = wall
                radial = points[nodes, :axes] - centre
                points[nodes, :axes] = centre + radius * radial / np.linalg.norm(radial, axis=1, keepdims=True)
                break
    return points


def onto_round_walls(
    mesh: VolumeMesh, points: np.ndarray, region: np.ndarray, cell: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Project points of roofs and sides radially onto the sphere or upright cylinder through all nodes of their wall.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh, with its nodes on the walls.
    points : (N, 3) ndarray
        Positions in mm, near the walls.
    region, cell : (N,) ndarray
        Code of the region and number of the cell of each point.

    Returns
    -------
    projected : (N, 3) ndarray
        Projected points in mm; points of other walls are unchanged.
    gradient : (N, 3, 3) ndarray
        Derivative of each projected point with respect to the point.
    """
    projected, gradient = points.copy(), np.tile(np.eye(3), (len(points), 1, 1))
    for code, number, wall in round_walls(mesh):
        selected = (region == code) & (cell == number)
        projected[selected], gradient[selected] = put_radially(points[selected], *wall)
    return projected, gradient


@kept(4)  # the states of a path share their mesh
def round_walls(mesh: VolumeMesh) -> list[tuple[int, int, tuple[np.ndarray, float, np.ndarray]]]:
    """Find the round walls of a mesh: spheres and vertical cylinders.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.

    Returns
    -------
    list[tuple[int, int, tuple[ndarray, float, ndarray]]]
        For each wall: the code of its region, the number of its cell, and its centre (3,) in mm, radius in mm, and the
        matrix (3, 3) that projects across its axis.
    """
    walls = []
    in_cell = np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"])) & (mesh.face_cell > 0)
    for code, number in np.unique(np.stack([mesh.face_region, mesh.face_cell])[:, in_cell], axis=1).T.tolist():
        faces = mesh.faces[(mesh.face_region == code) & (mesh.face_cell == number)]
        nodes = mesh.points[np.unique(faces)]
        for axes in (3, 2):
            if (wall := _round(nodes, axes)) is not None:
                walls.append((code, number, (np.append(wall[0], 0.0)[:3], wall[1], np.diag(np.arange(3) < axes) * 1.0)))
                break
    return walls


def _round(nodes: np.ndarray, axes: int) -> tuple[np.ndarray, float] | None:
    """Centre and radius of a sphere (``axes`` = 3) or an upright cylinder (``axes`` = 2) that passes through all nodes
    (N, 3); None if there is none.
    """
    centre, radius = _fitted(nodes[:, :axes])
    if radius > FLATTEST * np.linalg.norm(np.ptp(nodes[:, :axes], axis=0)):
        return None
    deviation = np.abs(np.linalg.norm(nodes[:, :axes] - centre, axis=1) / radius - 1).max()
    return (centre, radius) if deviation < ROUNDING else None


def _fitted(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Fit a sphere to points (N, 3), or a circle to points (N, 2), by least squares. Returns its centre and radius.

    The fit is linear in c and in the bracket of x.x = 2 c.x + (r^2 - c.c), for points x, centre c and radius r.
    """
    origin = points.mean(axis=0)
    centred = points - origin
    solution, *_ = np.linalg.lstsq(
        np.column_stack([2 * centred, np.ones(len(centred))]), (centred**2).sum(axis=1), rcond=None
    )
    centre = solution[:-1]
    return origin + centre, float(np.sqrt(max(solution[-1] + centre @ centre, 1e-300)))
