"""Edges of an undeformed pad at which the stress is singular, with the strips beside them, and corners of the rims of
its regions.
"""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.point_tree import PointTree
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, VolumeMesh
from mitsuba_taxel.pads.regions import REGIONS

STRIP = 0.02
"""Width of the strip along singular edges, relative to the pad's height.

There silicone folds under any load, in a region that grows with the load; smaller elements only show it earlier. Folds
within the strip are ignored.
"""

RIGHT_ANGLE_TOLERANCE = 5.0
"""Deviation in degrees within which an angle counts as right."""

CREASE = 150.0
"""Angle in degrees, on the side of the air, below which an inner edge of the undeformed pad is singular."""


@kept(4)  # several tests of contact share a mesh
def beyond_strip(mesh: VolumeMesh) -> np.ndarray:
    """Distance of nodes from the strips beside edges with singular stress; within these strips the surface may fold.

    Singular edges are the glued rim, and inner edges whose angle on the side of the air is below :data:`CREASE`.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.

    Returns
    -------
    (N,) ndarray
        Distance from the nearest singular edge in mm, less the width of the strip; infinite for nodes inside.
    """
    width = STRIP * float(np.ptp(mesh.points[:, 2]))
    edges = _singular_edges(mesh)
    if not len(edges):
        return np.ones(len(mesh.points))
    start, end = np.concatenate([mesh.points[edges[:, [0, 2]]], mesh.points[edges[:, [2, 1]]]]).swapaxes(0, 1)
    count = np.ceil(np.linalg.norm(end - start, axis=1) / width).astype(int)
    segment = np.arange(len(start)).repeat(count)
    fraction = (np.arange(len(segment)) - (np.cumsum(count) - count)[segment] + 0.5) / count[segment]
    samples = start[segment] + fraction[:, None] * (end - start)[segment]
    nodes, beyond = np.unique(mesh.faces), np.full(len(mesh.points), np.inf)
    nearest = segment[PointTree(samples).query(mesh.points[nodes])[1]]
    edge_vectors, offsets = (end - start)[nearest], mesh.points[nodes] - start[nearest]
    position = np.clip((edge_vectors * offsets).sum(axis=1) / (edge_vectors * edge_vectors).sum(axis=1), 0, 1)
    beyond[nodes] = np.linalg.norm(offsets - position[:, None] * edge_vectors, axis=1) - width
    return beyond


def judged_nodes(mesh: VolumeMesh) -> np.ndarray:
    """Nodes at which elements must not be inverted: those of the cells' walls, where light is reflected, except near
    edges with singular stress.

    At other nodes an element may be inverted, for example at the middle of an edge where silicone rolls over onto the
    board. At quadrature points, which determine its energy, no element may be inverted.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.

    Returns
    -------
    (N,) ndarray of bool
        True for a node at which elements must not be inverted.
    """
    walls = np.isin(mesh.face_region, [REGIONS["roof"], REGIONS["side"]])
    judged = np.zeros(len(mesh.points), dtype=bool)
    judged[mesh.faces[walls]] = True
    return judged & (beyond_strip(mesh) > 0)


def shared_edges(mesh: VolumeMesh) -> tuple[np.ndarray, np.ndarray]:
    """The E edges between two faces of the surface: their corners and middle node (E, 3), and the numbers (E, 2) of the
    two faces."""
    sides = mesh.faces[:, [[i, j, k] for k, (i, j) in enumerate(FACE_EDGES, start=3)]].reshape(-1, 3)
    order = np.argsort(sides[:, 2], kind="stable")
    first, second = order[:-1], order[1:]
    equal = sides[first, 2] == sides[second, 2]
    first, second = first[equal], second[equal]
    return sides[first], np.stack([first, second], axis=1) // 3


def _singular_edges(mesh: VolumeMesh) -> np.ndarray:
    """Corners and middle node (E, 3) of each of E singular edges."""
    edges, faces = shared_edges(mesh)
    first, second = faces.T
    glued = mesh.face_region[first] == REGIONS["bottom"], mesh.face_region[second] == REGIONS["bottom"]
    a, b, c = np.moveaxis(mesh.points[mesh.faces[:, :3]], 1, 0)
    normal, centre = np.cross(b - a, c - a), (a + b + c) / 3
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    turn = np.rad2deg(np.arccos(np.clip((normal[first] * normal[second]).sum(axis=1), -1, 1)))
    inner = (normal[first] * (centre[second] - centre[first])).sum(axis=1) > 0
    singular = (glued[0] != glued[1]) | (inner & (180 - turn < CREASE))
    return edges[singular]


def rim_corners(mesh: VolumeMesh, region: str, least_turn: float) -> np.ndarray:
    """Corners of the outer rim of a region of an undeformed pad.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    region : str
        Region whose rim with the outside is used, "bottom" or "top".
    least_turn : float
        Least angle in degrees by which the rim turns at a corner.

    Returns
    -------
    (k,) ndarray of int
        Numbers of the k nodes at these corners.
    """
    edges, faces = shared_edges(mesh)
    regions = np.sort(mesh.face_region[faces], axis=1)
    rim = edges[(regions == sorted((REGIONS[region], REGIONS["outer"]))).all(axis=1), :2]
    vectors = np.diff(mesh.points[rim], axis=1)[:, 0]
    directions = np.stack([vectors, -vectors], axis=1).reshape(-1, 3)
    directions = directions / np.linalg.norm(vectors, axis=1).repeat(2)[:, None]
    total = np.zeros((len(mesh.points), 3))
    np.add.at(total, rim.ravel(), directions)  # the sum of two unit vectors is 2 sin(turn / 2) long
    return np.flatnonzero(np.linalg.norm(total, axis=1) > 2 * np.sin(np.deg2rad(least_turn / 2)))


def has_right_angled_top(mesh: VolumeMesh) -> bool:
    """Whether there is a corner of the top at which two upright sides meet at a right or an acute angle."""
    sides = mesh.faces[mesh.face_region == REGIONS["outer"], :3]
    a, b, c = np.moveaxis(mesh.points[sides], 1, 0)
    normal = np.cross(b - a, c - a)
    leaning = np.abs(normal[:, 2]) > np.sin(np.deg2rad(RIGHT_ANGLE_TOLERANCE)) * np.linalg.norm(normal, axis=1)
    return bool((~np.isin(rim_corners(mesh, "top", 90 - RIGHT_ANGLE_TOLERANCE), sides[leaning])).any())
