"""Whether curved elements are valid, and how to mend those that are not."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.errors import ComputationError
from mitsuba_taxel.pads.volume_mesh import TET_EDGES, VolumeMesh


def jacobians(points: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Determinant of the map of each tetrahedron at its ten nodes, relative to that of the straight one; (M, 10)."""
    xi = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    xi = np.concatenate([xi, [xi[list(edge)].mean(axis=0) for edge in TET_EDGES]])
    gradients = shape_gradients(xi)
    x = points[tets]
    mapped = np.einsum("qai,maj->mqij", gradients, x)
    corner = x[:, 1:4] - x[:, :1]
    return np.linalg.det(mapped) / np.linalg.det(corner)[:, None]


def shape_gradients(xi: np.ndarray) -> np.ndarray:
    """Gradients (Q, 10, 3) of the quadratic shape functions at reference points (Q, 3)."""
    barycentric = np.concatenate([1 - xi.sum(axis=1, keepdims=True), xi], axis=1)
    slope = np.array([[-1, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    gradients = np.empty((len(xi), 10, 3))
    gradients[:, :4] = (4 * barycentric - 1)[:, :, None] * slope
    for node, (i, j) in enumerate(TET_EDGES, start=4):
        gradients[:, node] = 4 * (barycentric[:, i, None] * slope[j] + barycentric[:, j, None] * slope[i])
    return gradients


def straighten_inverted(mesh: VolumeMesh, least: float = 0.1) -> np.ndarray:
    """Points of a mesh whose badly curved elements have had the nodes of their edges moved back to the middle.

    An element is bad where its map's determinant falls below ``least`` of that of the straight element. Neighbours
    of a straightened element are looked at again, until none is bad.
    """
    points = mesh.points.copy()
    for _ in range(10):
        bad = jacobians(points, mesh.tets).min(axis=1) < least
        if not bad.any():
            break
        tets = mesh.tets[bad]
        for node, (i, j) in enumerate(TET_EDGES, start=4):
            points[tets[:, node]] = 0.5 * (points[tets[:, i]] + points[tets[:, j]])
    return points


def check_elements(mesh: VolumeMesh) -> None:
    """Refuse a mesh with an inverted element.

    Raises
    ------
    ComputationError
        naming the place of the worst element.
    """
    corner = mesh.points[mesh.tets[:, 1:4]] - mesh.points[mesh.tets[:, :1]]
    volume = np.linalg.det(corner)
    quality = np.where(volume > 0, jacobians(mesh.points, mesh.tets).min(axis=1), volume)
    worst = int(np.argmin(quality))
    if quality[worst] <= 0:
        x, y, z = mesh.points[mesh.tets[worst, :4]].mean(axis=0)
        raise ComputationError(
            f"the mesh has an inverted element near ({x:.3g}, {y:.3g}, {z:.3g}) mm: choose another mesh_size."
        )
