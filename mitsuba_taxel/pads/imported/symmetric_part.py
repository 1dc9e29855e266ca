"""Mirror symmetries of a closed surface, and its symmetric part, closed along the mirror planes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from mitsuba_taxel.geometry.mirror import (
    ACROSS_DIAGONAL,
    ACROSS_SECOND_DIAGONAL,
    ACROSS_X,
    ACROSS_Y,
    MIRRORS,
    Mirror,
    mirrored,
)
from mitsuba_taxel.geometry.surfaces.box_tree import TooManyPairs
from mitsuba_taxel.geometry.surfaces.polygons import triangulated
from mitsuba_taxel.geometry.surfaces.triangles import closest_on_triangles, half_edges, near, subdivided
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.imported.regions import numbered

TOLERANCE = 5e-5
"""Largest distance of a surface from its mirror image, relative to its diagonal. It allows for the chords of curved
walls that programs export, and is about a micrometre for a pad of 17 mm."""
SEAM = 1e-3
"""Fraction of a region's vertices whose images may lie just beside it: on a curved wall its border follows triangles.
"""
ON_PLANE = 1e-5
"""Distance from a plane of symmetry, relative to the diagonal, below which a vertex is moved onto it."""
PLANE = 0
"""Region code of the caps that close a symmetric part along the planes of symmetry."""


def mirrors_of(vertices: np.ndarray, triangles: np.ndarray, region: np.ndarray) -> tuple[Mirror, ...]:
    """The group of mirrors under which a surface and its regions are invariant.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    region : (T,) ndarray of int
        Code of the region of each triangle.

    Returns
    -------
    tuple[Mirror, ...]
        Mirrors; empty if there is no symmetry.
    """
    tolerance = TOLERANCE * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return group_of(mirror for mirror in MIRRORS if _is_invariant(mirror, vertices, triangles, region, tolerance))


def group_of(mirrors: Iterable[Mirror]) -> tuple[Mirror, ...]:
    """Complete a set of planes of symmetry to a group: add all planes that follow from combinations of the given ones.
    """
    generators = set(mirrors)
    if len(generators) > 2:
        return MIRRORS
    for pair in ((ACROSS_X, ACROSS_Y), (ACROSS_DIAGONAL, ACROSS_SECOND_DIAGONAL)):
        if generators.issuperset(pair):
            return pair
    return tuple(generators) if len(generators) == 1 else ()


def _is_invariant(
    mirror: Mirror, vertices: np.ndarray, triangles: np.ndarray, region: np.ndarray, tolerance: float
) -> bool:
    """Whether the image of every region of a surface lies on the region, within a tolerance in mm."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    image = mirror.image(vertices)
    if np.abs(image.min(axis=0) - low).max() > tolerance or np.abs(image.max(axis=0) - high).max() > tolerance:
        return False
    has_image = np.ones(len(vertices), dtype=bool)
    has_image[triangles] = False
    for code in np.unique(region):
        region_triangles = triangles[region == code]
        number = np.unique(region_triangles)
        points, corners = image[number], vertices[region_triangles]
        try:
            point, triangle = near(points, corners, tolerance)
        except TooManyPairs:
            return False
        distance = np.linalg.norm(closest_on_triangles(points[point], corners[triangle]) - points[point], axis=1)
        with_image = np.unique(point[distance <= tolerance])
        if len(with_image) < (1 - SEAM) * len(points):
            return False
        has_image[number[with_image]] = True
    return bool(has_image.all())


def planes_of(mirrors: Sequence[Mirror]) -> tuple[Mirror, ...]:
    """Mirrors of a symmetry group whose planes bound the symmetric part of a pad."""
    return (ACROSS_Y, ACROSS_DIAGONAL) if len(mirrors) == len(MIRRORS) else tuple(mirrors)


def completed(mesh: VolumeMesh, mirrors: Sequence[Mirror]) -> VolumeMesh:
    """The mesh of a symmetric part, completed by its mirror images.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the part; its faces along the planes have the region :data:`PLANE`.
    mirrors : sequence of Mirror
        The group of the symmetry.

    Returns
    -------
    VolumeMesh
        Mesh of the pad, with cells numbered.
    """
    on_surface = mesh.face_region != PLANE
    kept = (mesh.faces[on_surface], mesh.face_region[on_surface], mesh.face_cell[on_surface])
    mesh = VolumeMesh(mesh.points, mesh.tets, *kept)
    for mirror in (ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y) if len(mirrors) == len(MIRRORS) else mirrors:
        mesh = mirrored(mesh, mirror)
    return numbered(mesh)


def symmetric_part_of(
    vertices: np.ndarray, triangles: np.ndarray, planes: Sequence[Mirror]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut a closed surface along planes of symmetry and close it again.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    planes : sequence of Mirror
        Planes of symmetry; the part on the positive side of each plane is kept.

    Returns
    -------
    vertices : (W, 3) ndarray
        Positions in mm.
    triangles : (U, 3) ndarray of int
        Vertices of each triangle.
    origin : (U,) ndarray of int
        Number of the original triangle; -1 for the caps along the planes.
    """
    origin = np.arange(len(triangles))
    tolerance = ON_PLANE * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    for mirror in planes:
        vertices, triangles, parent = _cut(vertices, triangles, mirror, tolerance)
        origin = origin[parent]
        cap = _cap(vertices, triangles, mirror)
        triangles = np.concatenate([triangles, cap])
        origin = np.concatenate([origin, np.full(len(cap), -1)])
    used, triangles = np.unique(triangles, return_inverse=True)
    return onto_planes(vertices[used], planes, tolerance), triangles.reshape(-1, 3), origin


def onto_planes(points: np.ndarray, planes: Sequence[Mirror], tolerance: float) -> np.ndarray:
    """Move points near planes of symmetry exactly onto them.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    planes : sequence of Mirror
        The planes.
    tolerance : float
        Largest distance of the points that are moved, mm.

    Returns
    -------
    (N, 3) ndarray
        Positions in mm.
    """
    points, axis = points.copy(), np.ones(len(points), dtype=bool)
    for mirror in planes:
        on = np.abs(mirror.side(points)) <= tolerance
        points[on] = 0.5 * (points[on] + mirror.image(points[on]))
        axis &= on
    if len(planes) > 1:
        points[axis, :2] = 0.0
    return points


def exactly_on(points: np.ndarray, planes: Sequence[Mirror], height: float, tolerance: float) -> np.ndarray:
    """Move points near planes of symmetry, the board or the top exactly onto them.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    planes : sequence of Mirror
        The planes of symmetry.
    height : float
        z of the top, mm.
    tolerance : float
        Largest distance of the points that are moved, mm.

    Returns
    -------
    (N, 3) ndarray
        Positions in mm.
    """
    points = onto_planes(points, planes, tolerance)
    for level in (0.0, height):
        points[np.abs(points[:, 2] - level) <= tolerance, 2] = level
    return points


def _cut(
    vertices: np.ndarray, triangles: np.ndarray, mirror: Mirror, tolerance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut a surface along a plane of symmetry. Returns the triangles on the kept side, and the number of the original
    triangle of each."""
    vertices = onto_planes(vertices, [mirror], tolerance)
    sign = np.sign(mirror.side(vertices))
    edges, number = np.unique(np.sort(half_edges(triangles)[0], axis=1), axis=0, return_inverse=True)
    across = sign[edges].prod(axis=1) < 0
    midpoint = np.where(across, len(vertices) + np.cumsum(across) - 1, -1)
    start, end = vertices[edges[across]].swapaxes(0, 1)
    side = mirror.side(start)
    crossing = start + (side / (side - mirror.side(end)))[:, None] * (end - start)
    vertices = np.concatenate([vertices, 0.5 * (crossing + mirror.image(crossing))])
    sign = np.concatenate([sign, np.zeros(len(crossing))])
    triangles, parent = subdivided(vertices, triangles, midpoint[number.reshape(-1, 3)])
    kept = (sign[triangles].min(axis=1) >= 0) & (sign[triangles].max(axis=1) > 0)
    return vertices, triangles[kept], parent[kept]


def _cap(vertices: np.ndarray, triangles: np.ndarray, mirror: Mirror) -> np.ndarray:
    """Triangles (C, 3) in the plane of a mirror that close the cut."""
    edges, _ = half_edges(triangles)
    backward = edges[:, ::-1]
    count = len(vertices)
    open_edges = ~np.isin(edges[:, 0] * count + edges[:, 1], backward[:, 0] * count + backward[:, 1])
    right = np.array([mirror.normal[1], -mirror.normal[0]], dtype=float)  # seen from the removed side, z upwards
    flat = np.stack([vertices[:, :2] @ right, vertices[:, 2]], axis=1)
    return triangulated(flat, backward[open_edges])
