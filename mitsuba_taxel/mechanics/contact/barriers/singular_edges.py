"""The edges of an undeformed pad at which the stress is singular, and the strip of surface beside them."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.point_tree import PointTree
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, VolumeMesh
from mitsuba_taxel.pads.regions import REGIONS

STRIP = 0.02
"""Width of the strip along singular edges, relative to the pad's height.

There silicone folds under any load, however small, in a place that grows with the load: smaller elements only show it
earlier. What happens within the strip alone is without consequence.
"""

CREASE = 150.0
"""Angle of air in degrees at an inner edge of the undeformed pad, below which the edge is singular."""


@kept(4)  # several tests of contact share a mesh
def beyond_strip(mesh: VolumeMesh) -> np.ndarray:
    """(N,) mm, distance of nodes of the surface from the singular edges of the undeformed pad, less the width of the
    strip; infinite inside.

    Singular are the glued rim, and inner edges with less than :data:`CREASE` of air.
    """
    width = STRIP * float(np.ptp(mesh.points[:, 2]))
    edges = _singular_edges(mesh)
    if not len(edges):
        return np.ones(len(mesh.points))
    start, end = np.concatenate([mesh.points[edges[:, [0, 2]]], mesh.points[edges[:, [2, 1]]]]).swapaxes(0, 1)
    count = np.ceil(np.linalg.norm(end - start, axis=1) / width).astype(int)
    segment = np.arange(len(start)).repeat(count)
    share = (np.arange(len(segment)) - (np.cumsum(count) - count)[segment] + 0.5) / count[segment]
    places = start[segment] + share[:, None] * (end - start)[segment]
    nodes, beyond = np.unique(mesh.faces), np.full(len(mesh.points), np.inf)
    nearest = segment[PointTree(places).query(mesh.points[nodes])[1]]
    along, towards = (end - start)[nearest], mesh.points[nodes] - start[nearest]
    part = np.clip((along * towards).sum(axis=1) / (along * along).sum(axis=1), 0, 1)
    beyond[nodes] = np.linalg.norm(towards - part[:, None] * along, axis=1) - width
    return beyond


def judged_nodes(mesh: VolumeMesh) -> np.ndarray:
    """Nodes at which elements must not be inverted: those on the cells' walls, which light meets, but not in the strip.

    Elsewhere an element may fold at the middle of an edge, as it does where silicone rolls over onto the board. The
    energy of an element is that at its quadrature points, where it may not.

    Parameters
    ----------
    mesh : VolumeMesh
        Of the undeformed pad.

    Returns
    -------
    (N,) ndarray of bool
        Of each node.
    """
    walls = np.isin(mesh.face_region, [REGIONS["roof"], REGIONS["side"]])
    judged = np.zeros(len(mesh.points), dtype=bool)
    judged[mesh.faces[walls]] = True
    return judged & (beyond_strip(mesh) > 0)


def shared_edges(mesh: VolumeMesh) -> tuple[np.ndarray, np.ndarray]:
    """(E, 3) corners and middle node of the edges between two faces of the surface, and (E, 2) numbers of these."""
    sides = mesh.faces[:, [[i, j, k] for k, (i, j) in enumerate(FACE_EDGES, start=3)]].reshape(-1, 3)
    order = np.argsort(sides[:, 2], kind="stable")
    one, other = order[:-1], order[1:]
    pairs = sides[one, 2] == sides[other, 2]
    one, other = one[pairs], other[pairs]
    return sides[one], np.stack([one, other], axis=1) // 3


def _singular_edges(mesh: VolumeMesh) -> np.ndarray:
    """(E, 3) corners and middle node of singular edges."""
    edges, faces = shared_edges(mesh)
    one, other = faces.T
    glued = mesh.face_region[one] == REGIONS["bottom"], mesh.face_region[other] == REGIONS["bottom"]
    a, b, c = np.moveaxis(mesh.points[mesh.faces[:, :3]], 1, 0)
    normal, centre = np.cross(b - a, c - a), (a + b + c) / 3
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    turn = np.rad2deg(np.arccos(np.clip((normal[one] * normal[other]).sum(axis=1), -1, 1)))
    inner = (normal[one] * (centre[other] - centre[one])).sum(axis=1) > 0
    singular = (glued[0] != glued[1]) | (inner & (180 - turn < CREASE))
    return edges[singular]
