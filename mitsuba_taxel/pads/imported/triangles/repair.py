"""Repair the triangles of a file to a closed, outward surface of one body, or report where that fails."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.geometry_error import GeometryError, place
from mitsuba_taxel.geometry.point_tree import PointTree
from mitsuba_taxel.geometry.surfaces.box_tree import MOST_PAIRS, TooManyPairs, overlapping
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, components, half_edges, neighbours, unit, volume

ROUNDING = 6
"""Decimals of a mm that coordinates are rounded to, which removes the single-precision error of lengths such as
4.55."""
WELD = 1e-6
"""Distance below which vertices are merged, relative to the diagonal of the surface."""
TINY_HOLE = 0.01
"""Size below which a hole of any shape is filled, relative to the diagonal; a missing triangle always is."""
CHUNK = 1_000_000
MOST_COMPARED = 4 * MOST_PAIRS
"""Largest number of pairs of triangles tested for intersection: a minute's work."""


def repaired(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The closed surface of a body, from triangles of a file.

    Coincident vertices are merged; degenerate and duplicate triangles removed; triangles oriented consistently
    outwards; missing triangles and tiny holes filled.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        In mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Returns
    -------
    vertices : (W, 3) ndarray
        In mm.
    triangles : (U, 3) ndarray of int
        Vertices of each triangle, counter-clockwise seen from outside.

    Raises
    ------
    GeometryError
        with its place, if the surface is open, intersects itself, has edges of three or more triangles, cannot be
        oriented consistently, or is that of several bodies or of one with an enclosed hollow; without it if too much of
        the surface lies in one place.
    """
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    vertices, triangles = _welded(np.round(vertices, ROUNDING), triangles, WELD * diagonal)
    triangles = _distinct(triangles)
    if not len(triangles):
        raise GeometryError("none of its triangles has an area")
    _check_manifold(vertices, triangles)
    triangles = _filled(vertices, _consistent(vertices, triangles), TINY_HOLE * diagonal)
    _check_one_body(vertices, triangles)
    _check_crossings(vertices, triangles, 2 * WELD * diagonal)
    if volume(vertices, triangles) < 0:
        triangles = triangles[:, ::-1]
    used, triangles = np.unique(triangles, return_inverse=True)
    return vertices[used], triangles.reshape(-1, 3)


def _welded(vertices: np.ndarray, triangles: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    unique, number = np.unique(vertices, axis=0, return_inverse=True)
    tree = PointTree(unique)
    if tree.count_pairs(tolerance) > MOST_PAIRS:
        raise GeometryError(f"too many of its vertices lie within {tolerance:.2g} mm of each other")
    part = components(len(unique), tree.query_pairs(tolerance))
    _, first = np.unique(part, return_index=True)
    return unique[first], part[number.reshape(-1)][triangles]


def _distinct(triangles: np.ndarray) -> np.ndarray:
    """The triangles with three distinct corners, without duplicates."""
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    return triangles[np.sort(first)]


def _check_manifold(vertices: np.ndarray, triangles: np.ndarray) -> None:
    edges, _ = half_edges(triangles)
    edges, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    if count.max() > 2:
        worst = int(count.argmax())
        middle = place(vertices[edges[worst]].mean(axis=0))
        raise GeometryError(
            f"{count[worst]} triangles meet in one edge at {middle}; a surface with two at each is needed"
        )


def _consistent(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangles, oriented so that neighbours run along their common edge in opposite directions.

    Each triangle is two nodes of a graph, as given and reversed; compatible nodes are connected. The surface is
    orientable unless the two nodes of a triangle are.
    """
    edges, pairs = neighbours(triangles)
    count = len(triangles)
    same = _runs_along(triangles[pairs[:, 0]], edges) == _runs_along(triangles[pairs[:, 1]], edges)
    opposite = pairs[:, 1] + np.where(same, count, 0)
    links = np.stack([pairs[:, 0], opposite], axis=1)
    part = components(2 * count, np.concatenate([links, (links + count) % (2 * count)]))
    standing, turned = part[:count], part[count:]
    if np.any(standing == turned):
        where = place(vertices[triangles[np.argmax(standing == turned)]].mean(axis=0))
        raise GeometryError(f"its surface has no inside: its triangles cannot be oriented consistently at {where}")
    # Of the two orientations of a connected component, the one that reverses fewer triangles.
    votes = np.bincount(standing, minlength=part.max() + 1)
    turn = (votes[standing] < votes[turned]) | ((votes[standing] == votes[turned]) & (standing > turned))
    return np.where(turn[:, None], triangles[:, ::-1], triangles)


def _runs_along(triangles: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(E,) whether triangles (E, 3) run along their edges (E, 2) from the first vertex to the second."""
    here = triangles[:, [[0, 1], [1, 2], [2, 0]]] == edges[:, None]
    return np.any(np.all(here, axis=2), axis=1)


def _filled(vertices: np.ndarray, triangles: np.ndarray, tiny: float) -> np.ndarray:
    """The surface with triangles in its holes, if these have three edges or fit into a box of ``tiny``."""
    edges, _ = half_edges(triangles)
    _, number, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    rim = edges[count[number.reshape(-1)] == 1]
    following = dict(rim[:, ::-1].tolist())
    if len(following) < len(rim):
        twice = np.flatnonzero(np.bincount(rim[:, 1]) > 1)[0]
        raise GeometryError(f"its surface is open: holes meet at {place(vertices[twice])}; a closed surface is needed")
    patches: list[list[int]] = []
    while following:
        first, corner = following.popitem()
        hole = [first]
        while corner != first:
            hole.append(corner)
            corner = following.pop(corner)
        corners = vertices[hole]
        if len(hole) > 3 and np.ptp(corners, axis=0).max() > tiny:
            raise GeometryError(
                f"its surface is open: a hole at {place(corners.mean(axis=0))}; a closed surface is needed"
            )
        patches.extend([hole[0], hole[k], hole[k + 1]] for k in range(1, len(hole) - 1))
    return np.concatenate([triangles, np.array(patches, dtype=triangles.dtype).reshape(-1, 3)])


def _check_one_body(vertices: np.ndarray, triangles: np.ndarray) -> None:
    _, pairs = neighbours(triangles)
    part = components(len(triangles), pairs)
    if part.max() > 0:
        area = np.bincount(part, np.linalg.norm(area_normals(vertices, triangles), axis=1))
        other = vertices[triangles[part == np.argmin(area)]].reshape(-1, 3)
        middle = place(0.5 * (other.min(axis=0) + other.max(axis=0)))
        raise GeometryError(
            f"it has {part.max() + 1} separate surfaces, one of them round {middle}; one body without enclosed hollows "
            "is needed"
        )


def _check_crossings(vertices: np.ndarray, triangles: np.ndarray, tolerance: float) -> None:
    """Refuse triangles pierced by an edge of another one, by more than ``tolerance`` on all sides."""
    corners = vertices[triangles]
    parts, compared = [np.arange(len(triangles))], 0
    while parts:
        part = parts.pop()
        try:
            first, second = _near_each_other(corners, part)
        except TooManyPairs:
            parts.extend(np.array_split(part, 8))
            continue
        compared += len(first)
        if compared > MOST_COMPARED:
            raise GeometryError("too many of its triangles lie across each other")
        _check_pairs(vertices, triangles, first, second, tolerance)


def _near_each_other(corners: np.ndarray, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (P,), (P,) of a triangle of a ``part`` and another one whose bounding boxes overlap."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    first, second = overlapping(low[part], high[part], low, high)
    different = part[first] != second
    return part[first[different]], second[different]


def _check_pairs(
    vertices: np.ndarray, triangles: np.ndarray, first: np.ndarray, second: np.ndarray, tolerance: float
) -> None:
    corners = vertices[triangles]
    for start in range(0, len(first), CHUNK):
        one, other = first[start : start + CHUNK], second[start : start + CHUNK]
        for k in range(3):
            ends = triangles[one][:, [k, (k + 1) % 3]]
            apart = ~np.any(ends[:, :, None] == triangles[other][:, None], axis=(1, 2))
            through, where = _pierced(vertices[ends[apart]], corners[other[apart]], tolerance)
            if through.any():
                raise GeometryError(f"its surface intersects itself at {place(where[np.argmax(through)])}")


def _pierced(segments: np.ndarray, corners: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """(N,) whether segments (N, 2, 3) pass through triangles (N, 3, 3), and where (N, 3) they meet their planes."""
    a, b, c = (corners[:, k] for k in range(3))
    normal = unit(np.cross(b - a, c - a))
    height = np.einsum("nkj,nj->nk", segments - a[:, None], normal)
    through = (height.min(axis=1) < -tolerance) & (height.max(axis=1) > tolerance)
    drop = height[:, 0] - height[:, 1]
    fraction = height[:, 0] / np.where(through, drop, 1.0)
    where = segments[:, 0] + fraction[:, None] * (segments[:, 1] - segments[:, 0])
    for start, end in ((a, b), (b, c), (c, a)):
        inwards = np.cross(normal, unit(end - start))
        through &= np.einsum("ij,ij->i", where - start, inwards) > tolerance
    return through, where


def faces_of(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Number of the face of each triangle: its own, but slivers belong to the neighbour across a long edge.

    A sliver has no usable normal, but without it the surface would not be closed.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        In mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Returns
    -------
    (T,) ndarray of int
        Numbers of triangles.
    """
    corners = vertices[triangles]
    length = np.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2)
    flat = is_sliver(vertices, triangles)
    edges, pairs = neighbours(triangles)
    reach = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    longest = length.max(axis=1)
    long = np.any(flat[pairs] & (reach[:, None] >= longest[pairs] * (1 - 1e-12)), axis=1)
    return components(len(triangles), pairs[long])


def is_sliver(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T,) whether the vertices of a triangle are collinear up to rounding."""
    corners = vertices[triangles]
    longest = np.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2).max(axis=1)
    diagonal = np.linalg.norm(np.ptp(vertices, axis=0))
    return 2 * np.linalg.norm(area_normals(vertices, triangles), axis=1) <= WELD * diagonal * longest
