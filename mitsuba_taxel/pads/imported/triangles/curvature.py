"""Radius of curvature of the patches of a surface of triangles, independent of the directions of their edges.

The curvature tensor is averaged over the edges around each vertex (D. Cohen-Steiner and J.-M. Morvan, Restricted
Delaunay triangulations and normal cycle, 2003).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import csr_array

from mitsuba_taxel.geometry.surfaces.triangles import area_normals, neighbours
from mitsuba_taxel.pads.imported.triangles.snapping import Patches

FLAT_ANGLE = 1.0
"""Degrees between neighbouring triangles below which they belong to one plane."""
LOW = 25
"""Percentile of the radii on a patch that is returned."""


def radii(patches: Patches) -> np.ndarray:
    """Radius of curvature (P,) of each of P patches in mm: a low percentile of the smaller principal radius; infinite
    for planes."""
    triangles, patch = patches.triangles, patches.patch
    edges, pairs = neighbours(triangles)
    inside = patch[pairs[:, 0]] == patch[pairs[:, 1]]
    edges, pairs = edges[inside], pairs[inside]
    angle, tensor = _edge_curvature(patches, edges, pairs)
    # A vertex counts once for each patch that it belongs to.
    corner_keys, at_corner = np.unique(triangles * patches.count + patch[:, None], return_inverse=True)
    ends = np.searchsorted(corner_keys, edges * patches.count + patch[pairs[:, :1]])
    of_edges = csr_array(
        (np.ones(ends.size), (ends.ravel(), np.repeat(np.arange(len(edges)), 2))), shape=(len(corner_keys), len(edges))
    )
    around = ((of_edges @ of_edges.T) > 0).astype(float)  # a vertex and its neighbours
    area = np.repeat(np.linalg.norm(area_normals(patches.vertices, triangles), axis=1) / 3, 3)
    total = around @ (of_edges @ (0.5 * tensor.reshape(-1, 9)))
    curved = of_edges @ (np.abs(angle) > math.radians(FLAT_ANGLE)).astype(float) > 0
    mean = total[curved] / (around @ np.bincount(at_corner.ravel(), area))[curved, None]
    smallest = 1 / np.abs(np.linalg.eigvalsh(mean.reshape(-1, 3, 3))).max(axis=1)
    radius, number = np.full(patches.count, np.inf), corner_keys[curved] % patches.count
    for patch_number in np.unique(number):
        radius[patch_number] = np.percentile(smallest[number == patch_number], LOW)
    return radius


def _edge_curvature(patches: Patches, edges: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angle (E,) between the two triangles at each of E edges, positive where concave, and the edge's contribution (E,
    3, 3) in mm to the integral of the curvature tensor."""
    first, second = patches.normals[pairs.T]
    start, end = patches.vertices[edges.T]
    beyond = patches.vertices[patches.triangles[pairs[:, 1]]].mean(axis=1) - start
    angle = np.arctan2(np.linalg.norm(np.cross(first, second), axis=1), np.einsum("ei,ei->e", first, second))
    angle = np.copysign(angle, np.einsum("ei,ei->e", first, beyond))
    along = end - start
    return angle, np.einsum("e,ei,ej->eij", angle / np.linalg.norm(along, axis=1), along, along)
