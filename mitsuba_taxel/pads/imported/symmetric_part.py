"""The mirrors of a closed surface, and the part of it that they complete, closed along their planes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from mitsuba_taxel.geometry.box_tree import TooManyPairs
from mitsuba_taxel.geometry.mirror import (
    ACROSS_DIAGONAL,
    ACROSS_SECOND_DIAGONAL,
    ACROSS_X,
    ACROSS_Y,
    MIRRORS,
    Mirror,
    mirrored,
)
from mitsuba_taxel.geometry.polygons import triangulated
from mitsuba_taxel.geometry.triangles import closest_on_triangles, half_edges, near, subdivided
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.imported.regions import numbered

TOLERANCE = 1e-6
"""How far the image of a surface may be off the surface, relative to its diagonal: what single precision leaves."""
ON_PLANE = 1e-5
"""Distance from a plane of symmetry, relative to the diagonal, under which a vertex is put onto it."""
PLANE = 0
"""Region code of what closes a part of a pad along its planes of symmetry."""


def mirrors_of(vertices: np.ndarray, triangles: np.ndarray, region: np.ndarray) -> tuple[Mirror, ...]:
    """The mirrors, a whole group, that leave a surface and the regions (T,) of its triangles as they are."""
    tolerance = TOLERANCE * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return group_of(mirror for mirror in MIRRORS if _keeps(mirror, vertices, triangles, region, tolerance))


def group_of(mirrors: Iterable[Mirror]) -> tuple[Mirror, ...]:
    """The whole group of mirrors that some make which leave a pad as it is."""
    found = set(mirrors)
    if len(found) > 2:
        return MIRRORS
    for pair in ((ACROSS_X, ACROSS_Y), (ACROSS_DIAGONAL, ACROSS_SECOND_DIAGONAL)):
        if found.issuperset(pair):
            return pair
    return tuple(found) if len(found) == 1 else ()


def _keeps(mirror: Mirror, vertices: np.ndarray, triangles: np.ndarray, region: np.ndarray, tolerance: float) -> bool:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    moved = mirror.image(vertices)
    if np.abs(moved.min(axis=0) - low).max() > tolerance or np.abs(moved.max(axis=0) - high).max() > tolerance:
        return False
    for code in np.unique(region):
        own = triangles[region == code]
        points, corners = moved[np.unique(own)], vertices[own]
        try:
            point, triangle = near(points, corners, tolerance)
        except TooManyPairs:
            return False
        off = np.linalg.norm(closest_on_triangles(points[point], corners[triangle]) - points[point], axis=1)
        if len(np.unique(point[off <= tolerance])) < len(points):
            return False
    return True


def planes_of(mirrors: Sequence[Mirror]) -> tuple[Mirror, ...]:
    """The mirrors of a group between whose planes the part lies."""
    return (ACROSS_Y, ACROSS_DIAGONAL) if len(mirrors) == len(MIRRORS) else tuple(mirrors)


def whole(mesh: VolumeMesh, mirrors: Sequence[Mirror]) -> VolumeMesh:
    """The mesh of the part between the planes of a group of mirrors, completed by its images.

    Its faces along the planes are of the region :data:`PLANE`.
    """
    on_surface = mesh.face_region != PLANE
    kept = (mesh.faces[on_surface], mesh.face_region[on_surface], mesh.face_cell[on_surface])
    mesh = VolumeMesh(mesh.points, mesh.tets, *kept)
    for mirror in (ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y) if len(mirrors) == len(MIRRORS) else mirrors:
        mesh = mirrored(mesh, mirror)
    return numbered(mesh)


def kept_part(
    vertices: np.ndarray, triangles: np.ndarray, planes: Sequence[Mirror]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (V, 3) and triangles (T, 3) of the part on the kept side of ``planes``, and which (T,) each was.

    Those that close the part along the planes were none: -1.
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
    """Points (N, 3), those within ``tolerance`` of planes of symmetry exactly on them."""
    points, axis = points.copy(), np.ones(len(points), dtype=bool)
    for mirror in planes:
        on = np.abs(mirror.side(points)) <= tolerance
        points[on] = 0.5 * (points[on] + mirror.image(points[on]))
        axis &= on
    if len(planes) > 1:
        points[axis, :2] = 0.0
    return points


def exactly_on(points: np.ndarray, planes: Sequence[Mirror], height: float, tolerance: float) -> np.ndarray:
    """Points (N, 3), those within ``tolerance`` of planes of symmetry, the board or the top exactly on them."""
    points = onto_planes(points, planes, tolerance)
    for level in (0.0, height):
        points[np.abs(points[:, 2] - level) <= tolerance, 2] = level
    return points


def _cut(
    vertices: np.ndarray, triangles: np.ndarray, mirror: Mirror, tolerance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The triangles on the kept side of a plane, those across it cut, and which they were."""
    vertices = onto_planes(vertices, [mirror], tolerance)
    sign = np.sign(mirror.side(vertices))
    edges, number = np.unique(np.sort(half_edges(triangles)[0], axis=1), axis=0, return_inverse=True)
    across = sign[edges].prod(axis=1) < 0
    new = np.where(across, len(vertices) + np.cumsum(across) - 1, -1)
    start, end = vertices[edges[across]].swapaxes(0, 1)
    side = mirror.side(start)
    where = start + (side / (side - mirror.side(end)))[:, None] * (end - start)
    vertices = np.concatenate([vertices, 0.5 * (where + mirror.image(where))])
    sign = np.concatenate([sign, np.zeros(len(where))])
    triangles, parent = subdivided(vertices, triangles, new[number.reshape(-1, 3)])
    kept = (sign[triangles].min(axis=1) >= 0) & (sign[triangles].max(axis=1) > 0)
    return vertices, triangles[kept], parent[kept]


def _cap(vertices: np.ndarray, triangles: np.ndarray, mirror: Mirror) -> np.ndarray:
    """Triangles (C, 3) in the plane of a mirror that close what was cut there."""
    edges, _ = half_edges(triangles)
    backward = edges[:, ::-1]
    count = len(vertices)
    open_edges = ~np.isin(edges[:, 0] * count + edges[:, 1], backward[:, 0] * count + backward[:, 1])
    right = np.array([mirror.normal[1], -mirror.normal[0]], dtype=float)  # seen from the side that is gone, z upwards
    flat = np.stack([vertices[:, :2] @ right, vertices[:, 2]], axis=1)
    return triangulated(flat, backward[open_edges])
