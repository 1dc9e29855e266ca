"""Fields of a pad at points between its nodes, and gradients at the nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mitsuba_taxel.geometry.quadratic_shapes import (
    shape_gradients,
    tet_coordinates,
)
from mitsuba_taxel.geometry.volume_mesh import TET_EDGES, VolumeMesh
from mitsuba_taxel.mechanics.point_locator import PointLocator, locator_of


def carried(
    mesh: VolumeMesh, displacement: np.ndarray, pressure: np.ndarray, other: VolumeMesh, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate the displacements and pressures of a pad at the nodes of another mesh of the same pad.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh of the state.
    displacement : (N, 3) ndarray
        Displacements of the nodes in mm.
    pressure : (corners,) ndarray
        Pressures in MPa.
    other : VolumeMesh
        The other undeformed mesh.
    tolerance : float
        Largest distance in mm of its nodes from the silicone.

    Returns
    -------
    displacement : (N', 3) ndarray
        Displacement on the other mesh, mm.
    pressure : (corners',) ndarray
        Pressure on the other mesh, MPa.

    Raises
    ------
    InputError
        if a node is farther from the silicone.
    """
    at = PointLocator(mesh).locate(other.points, tolerance)
    corners = slice(other.corner_count)
    coordinates, nodes = tet_coordinates(at.reference[corners]), mesh.tets[at.element[corners], :4]
    return at.interpolate(displacement), (coordinates * pressure[nodes]).sum(axis=1)


def displacement_at(
    mesh: VolumeMesh, displacement: np.ndarray, points: Sequence[Sequence[float]] | np.ndarray, tolerance: float = 0.0
) -> np.ndarray:
    """Displacements of points of the silicone, by the elements' shape functions.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    displacement : (N, 3) ndarray
        Displacement of each node, in mm.
    points : (P, 3) array_like
        Points of the undeformed silicone, mm.
    tolerance : float
        Allowed distance of points from the silicone in mm; see :meth:`Location.interpolate`.

    Returns
    -------
    (P, 3) ndarray
        Displacements in mm.

    Raises
    ------
    InputError
        as :meth:`PointLocator.locate`.
    """
    return locator_of(mesh).locate(points, tolerance).interpolate(displacement)


def displacement_gradient(mesh: VolumeMesh, displacement: np.ndarray, selected: np.ndarray | None = None) -> np.ndarray:
    """Gradient of the displacement at each node: the mean over the elements around it.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    displacement : (N, 3) ndarray
        Displacements of the nodes in mm.
    selected : (N,) ndarray of bool, optional
        Nodes at which it is computed; by default all.

    Returns
    -------
    (N, 3, 3) ndarray
        Gradients, without unit; 0 at nodes that are not selected.
    """
    corners = np.concatenate([np.zeros((1, 3)), np.eye(3)])
    nodes = np.concatenate([corners, corners[np.array(TET_EDGES)].mean(axis=1)])
    reference = shape_gradients(nodes)
    selected = np.ones(len(mesh.points), dtype=bool) if selected is None else selected
    owners, gradients = [], []
    for local, slopes in enumerate(reference):
        around = mesh.tets[selected[mesh.tets[:, local]]]
        jacobian, deformed = (slopes.T @ values[around] for values in (mesh.points, displacement))
        gradients.append(np.linalg.solve(jacobian, deformed))
        owners.append(around[:, local])
    node, gradient = np.concatenate(owners), np.concatenate(gradients).reshape(-1, 9)
    total = np.stack([np.bincount(node, column, len(mesh.points)) for column in gradient.T], axis=1)
    number = np.maximum(np.bincount(node, minlength=len(mesh.points)), 1)
    return np.swapaxes((total / number[:, None]).reshape(-1, 3, 3), 1, 2)


def displacement_gradient_at(
    mesh: VolumeMesh, displacement: np.ndarray, points: Sequence[Sequence[float]] | np.ndarray, tolerance: float = 0.0
) -> np.ndarray:
    """Gradients of the displacement, du_i/dX_j, at points of the silicone.

    They are those of the element that contains the point, and discontinuous between elements.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    displacement : (N, 3) ndarray
        Displacement of each node, in mm.
    points : (P, 3) array_like
        Points of the undeformed silicone, mm.
    tolerance : float
        Allowed distance of points from the silicone in mm.

    Returns
    -------
    (P, 3, 3) ndarray
        Gradients, without unit.

    Raises
    ------
    InputError
        as :meth:`PointLocator.locate`.
    """
    return locator_of(mesh).locate(points, tolerance).gradient(displacement)
