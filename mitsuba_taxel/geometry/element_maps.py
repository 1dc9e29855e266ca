"""Validity of curved elements: Jacobians of their maps."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.quadratic_shapes import shape_gradients
from mitsuba_taxel.geometry.volume_mesh import TET_EDGES, VolumeMesh

_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
_NODES = np.concatenate([_CORNERS, [_CORNERS[list(edge)].mean(axis=0) for edge in TET_EDGES]])
"""Reference coordinates (10, 3) of the nodes of a tetrahedron."""
_AT_NODES = np.swapaxes(shape_gradients(_NODES), 1, 2).reshape(-1, len(_NODES))
"""(30, 10): derivatives, by the three reference coordinates at each node, of the shape function of every node."""


def jacobians(points: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Determinant of the map from the reference element to each curved tetrahedron at its ten nodes, divided by the
    determinant for the tetrahedron with straight edges.

    Parameters
    ----------
    points : (N, 3) ndarray
        Nodes, mm.
    tets : (M, 10) ndarray of int
        Nodes of each tetrahedron.

    Returns
    -------
    (M, 10) ndarray
        1 for straight elements; 0 or less where one is inverted.
    """
    corner = points[tets[:, 1:4]] - points[tets[:, :1]]
    return map_determinants(points, tets) / np.linalg.det(corner)[:, None]


def map_determinants(points: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Determinant of the map from the reference element to each curved tetrahedron, at its ten nodes.

    Parameters
    ----------
    points : (..., N, 3) ndarray
        Nodes, mm.
    tets : (M, 10) ndarray of int
        Nodes of each tetrahedron.

    Returns
    -------
    (..., M, 10) ndarray
        Determinants in mm³.
    """
    maps = _AT_NODES @ points[..., tets, :]
    return np.linalg.det(maps.reshape(*maps.shape[:-2], -1, 3, 3))


def curved_volume(mesh: VolumeMesh) -> float:
    """Volume of a mesh. The quadrature rule is exact to degree 3, which is the degree of the Jacobian determinants of
    quadratic tetrahedra; the volume is therefore exact.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of quadratic tetrahedra.

    Returns
    -------
    float
        Volume in mm³.
    """
    xi = np.array([[0.25] * 3, *(np.full((4, 3), 1 / 6) + np.eye(4, 3) / 3)])
    maps = np.einsum("qai,maj->mqij", shape_gradients(xi), mesh.points[mesh.tets])
    return float((np.linalg.det(maps) * [-2 / 15, *[3 / 40] * 4]).sum())


def worst_element(mesh: VolumeMesh) -> tuple[float, np.ndarray]:
    """The most distorted element of a mesh: its least relative determinant (see :func:`jacobians`), negative if the
    element is inverted, and its position.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of quadratic tetrahedra.

    Returns
    -------
    determinant : float
        The least of all.
    position : (3,) ndarray
        Centre of that element, mm.
    """
    corner = mesh.points[mesh.tets[:, 1:4]] - mesh.points[mesh.tets[:, :1]]
    quality = jacobians(mesh.points, mesh.tets).min(axis=1) * np.sign(np.linalg.det(corner))
    worst = int(np.argmin(quality))
    return float(quality[worst]), mesh.points[mesh.tets[worst, :4]].mean(axis=0)
