"""Repair of a few distorted elements of a mesh, by moving inner nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.geometry.element_maps import jacobians, map_determinants
from mitsuba_taxel.geometry.second_order import boundary_triangles
from mitsuba_taxel.geometry.volume_mesh import TET_EDGES, VolumeMesh

_DIRECTIONS = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)], dtype=float) - 1
_STEPS = (0.4, 0.2, 0.1, 0.05)
"""Steps of the search, relative to the mean length of the edges around a node."""
FLAT = 0.1
"""Volume of an element, relative to the median around a node, above which it counts as undistorted."""
TINY = 1e-6
"""Least gain of the quality for which a step is accepted."""


def untangled(mesh: VolumeMesh, least: float, sweeps: int = 8) -> VolumeMesh:
    """Improve distorted elements of a mesh by moving their inner nodes; nodes are moved only where the quality of the
    elements grows.

    A pattern search for each inner corner of a distorted element increases the least quality of the elements around it.
    Midpoints of its edges follow by half.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of quadratic tetrahedra, possibly with inverted ones.
    least : float
        Required determinant of the elements' maps, relative to that of the straight element.
    sweeps : int
        Number of sweeps over the nodes.

    Returns
    -------
    VolumeMesh
        Mesh with the same elements and surface; some elements may still be distorted.
    """
    points, tets = mesh.points.copy(), mesh.tets
    inner = np.ones(len(points), dtype=bool)
    inner[boundary_triangles(tets[:, :4])] = False
    edges = np.array(TET_EDGES)
    for _ in range(sweeps):
        bad = _quality(points, tets) < least
        nodes = np.unique(tets[bad, :4])
        if not bad.any():
            break
        for node in nodes[inner[nodes]]:
            around = tets[(tets[:, :4] == node).any(axis=1)]
            ends = around[:, edges]
            touching = (ends == node).any(axis=2)
            middles = np.unique(around[:, 4:][touching])
            length = np.linalg.norm(np.diff(points[ends[touching]], axis=1), axis=2).mean()
            weights = np.zeros((len(points), 1))
            weights[node], weights[middles] = 1.0, 0.5
            stencil, local = np.unique(around, return_inverse=True)
            local, weights, origin = local.reshape(around.shape), weights[stencil], points[stencil]
            move = np.zeros(3)
            best = float(_star_quality(origin, local))
            for step in _STEPS:
                # All directions are tried at once; after one is accepted, those after it start from there.
                directions = _DIRECTIONS
                while len(directions):
                    trials = move + step * length * directions
                    qualities = _star_quality(origin + weights * trials[:, None], local)
                    better = np.flatnonzero(qualities > best + TINY)
                    if not len(better):
                        break
                    best, move = float(qualities[better[0]]), trials[better[0]]
                    directions = directions[better[0] + 1 :]
            points[stencil] = origin + weights * move
    return replace(mesh, points=points)


def _quality(points: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Least relative determinant (M,) of each element, negative if the straight element is inverted."""
    corner = points[tets[:, 1:4]] - points[tets[:, :1]]
    return jacobians(points, tets).min(axis=1) * np.sign(np.linalg.det(corner))


def _star_quality(points: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Smallest quality (...) of the elements around a node, for nodes at positions (..., N, 3); flat elements count as
    distorted."""
    corner = points[..., tets[:, 1:4], :] - points[..., tets[:, :1], :]
    volume = np.linalg.det(corner)
    with np.errstate(divide="ignore", invalid="ignore"):
        quality = (map_determinants(points, tets) / volume[..., None]).min(axis=-1)
    flat = volume / np.median(np.abs(volume), axis=-1, keepdims=True) / FLAT
    return np.where(volume > 0, np.minimum(quality, flat), np.minimum(flat, -TINY)).min(axis=-1)
