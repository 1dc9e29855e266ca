"""Simplification of surfaces for display on a page: rims between regions are preserved."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.geometry.surfaces.triangles import area_normals

MOST_VERTICES = 6000
"""Largest number of vertices of a drawn surface.

Any browser draws such a surface in a few hundredths of a second, and a page with 21 load steps has about 3 MB."""
_FINEST, _STEP = 1 / 150, 1.15


class CoarseSurface(NamedTuple):
    """A simplified surface: indices (V,) of the kept vertices, the triangles (T, 3) between them, and regions (T,)."""

    kept: np.ndarray
    triangles: np.ndarray
    regions: np.ndarray


def coarsened(
    vertices: np.ndarray, triangles: np.ndarray, regions: np.ndarray, most_vertices: int = MOST_VERTICES
) -> CoarseSurface:
    """Simplify a surface of N vertices and M triangles, such that at most ``most_vertices`` vertices remain.

    Vertices in the same cube of a grid are merged into one of them if they belong to the same regions, so that rims
    between regions are preserved. The kept vertices are also material points of every deformed surface with the same
    triangles.

    Source: J. Rossignac and P. Borrel, Multi-resolution 3D approximations for rendering complex scenes, 1993.

    Parameters
    ----------
    vertices : (N, 3) ndarray
        Vertices in mm.
    triangles : (M, 3) ndarray
        Indices of vertices.
    regions : (M,) ndarray
        Region of each triangle, from 0 to 30.
    """
    touching = np.zeros(len(vertices), dtype=np.int64)
    for corner in triangles.T:
        np.bitwise_or.at(touching, corner, np.int64(1) << regions)
    size = _FINEST * np.ptp(vertices, axis=0).max()
    while True:
        cells = np.floor((vertices - vertices.min(axis=0)) / size).astype(np.int64)
        _, group = np.unique(np.column_stack([cells, touching]), axis=0, return_inverse=True)
        if group.max() < most_vertices:
            break
        size *= _STEP
    group = group.ravel()
    merged = group[triangles]
    proper = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    kept, merged = _nearest_to_centres(vertices, group), merged[proper]
    # A thin triangle may be inverted, and would then show its back.
    before, now = _normals_about(vertices, triangles, regions)[proper], area_normals(vertices[kept], merged)
    folded = np.einsum("ij,ij->i", before, now) < 0
    return CoarseSurface(kept, np.where(folded[:, None], merged[:, ::-1], merged), regions[proper])


def _normals_about(vertices: np.ndarray, triangles: np.ndarray, regions: np.ndarray) -> np.ndarray:
    """Sums (M, 3) of the area normals around the corners of each triangle, within its region.

    The normal of a single triangle may be too small.
    """
    _, corner = np.unique(triangles.astype(np.int64) * 32 + regions[:, None], return_inverse=True)
    corner, normals = corner.reshape(triangles.shape), area_normals(vertices, triangles)
    columns = [np.bincount(corner.ravel(), np.repeat(column, 3))[corner].sum(axis=1) for column in normals.T]
    return np.column_stack(columns)


def _nearest_to_centres(vertices: np.ndarray, group: np.ndarray) -> np.ndarray:
    """The vertex of each group nearest to the group's centre."""
    count = np.bincount(group)
    centres = np.column_stack([np.bincount(group, column) for column in vertices.T]) / count[:, None]
    distance = np.linalg.norm(vertices - centres[group], axis=1)
    order = np.lexsort((distance, group))
    return order[np.searchsorted(group[order], np.arange(len(count)))]
