"""Repair of the triangles of a file to a closed surface of one body, oriented outwards; reports the position where this
fails."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.geometry_error import GeometryError, place
from mitsuba_taxel.geometry.point_tree import PointTree
from mitsuba_taxel.geometry.surfaces.box_tree import MOST_PAIRS, TooManyPairs, overlapping
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, components, half_edges, neighbours, unit, volume

ROUNDING = 6
"""Decimals in mm to which coordinates are rounded: this removes the single-precision error of lengths such as 4.55."""
WELD = 1e-6
"""Distance below which vertices are merged, relative to the diagonal of the surface."""
TINY_HOLE = 0.01
"""Size, relative to the diagonal, below which a hole of any shape is filled; a single missing triangle is always
filled."""
CHUNK = 1_000_000
MOST_COMPARED = 4 * MOST_PAIRS
"""Largest number of pairs of triangles tested for intersection: about a minute's work."""


def repaired(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The closed surface of a body, from triangles of a file.

    Coincident vertices are merged, degenerate and duplicate triangles removed, triangles oriented consistently
    outwards, and missing triangles and tiny holes filled.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Returns
    -------
    vertices : (W, 3) ndarray
        Positions in mm.
    triangles : (U, 3) ndarray of int
        Vertices of each triangle, counter-clockwise seen from outside.

    Raises
    ------
    GeometryError
        with the position, if the surface is open, intersects itself, has edges of three or more triangles, cannot be
        oriented consistently, or belongs to several bodies or to a body with an enclosed hollow. The error has no
        position if too many triangles lie at the same position.
    """
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    vertices, triangles = _welded(np.round(vertices, ROUNDING), triangles, WELD * diagonal)
    triangles = _distinct(triangles)
    if not len(triangles):
        raise GeometryError("none of its triangles has an area; a closed surface is needed")
    _check_manifold(vertices, triangles)
    triangles = _filled(vertices, _consistent(vertices, triangles), TINY_HOLE * diagonal)
    _check_one_body(vertices, triangles)
    _check_crossings(vertices, triangles, 2 * WELD * diagonal)
    if volume(vertices, triangles) < 0:
        triangles = triangles[:, ::-1]
    used, triangles = np.unique(triangles, return_inverse=True)
    return vertices[used], triangles.reshape(-1, 3)


def _welded(vertices: np.ndarray, triangles: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Merge vertices that coincide within a tolerance in mm; returns the new vertices and triangles."""
    unique, number = np.unique(vertices, axis=0, return_inverse=True)
    tree = PointTree(unique)
    if tree.count_pairs(tolerance) > MOST_PAIRS:
        raise GeometryError(
            f"too many of its vertices lie within {tolerance:.2g} mm of each other; larger triangles are needed"
        )
    component = components(len(unique), tree.query_pairs(tolerance))
    _, first = np.unique(component, return_index=True)
    return unique[first], component[number.reshape(-1)][triangles]


def _distinct(triangles: np.ndarray) -> np.ndarray:
    """Remove triangles with coincident corners, and duplicate triangles."""
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
    """Orient triangles consistently: neighbours run along their common edge in opposite directions.

    In a graph, each triangle is two nodes, one for each orientation; compatible nodes are connected. The surface is
    orientable unless the two nodes of a triangle are connected.
    """
    edges, pairs = neighbours(triangles)
    count = len(triangles)
    same = _runs_along(triangles[pairs[:, 0]], edges) == _runs_along(triangles[pairs[:, 1]], edges)
    opposite = pairs[:, 1] + np.where(same, count, 0)
    links = np.stack([pairs[:, 0], opposite], axis=1)
    component = components(2 * count, np.concatenate([links, (links + count) % (2 * count)]))
    forward, backward = component[:count], component[count:]
    if np.any(forward == backward):
        where = place(vertices[triangles[np.argmax(forward == backward)]].mean(axis=0))
        raise GeometryError(
            f"its surface has no inside: its triangles cannot be oriented consistently at {where}; repair it there"
        )
    # Of the two orientations of a connected component, the one that reverses fewer triangles.
    votes = np.bincount(forward, minlength=component.max() + 1)
    reverse = (votes[forward] < votes[backward]) | ((votes[forward] == votes[backward]) & (forward > backward))
    return np.where(reverse[:, None], triangles[:, ::-1], triangles)


def _runs_along(triangles: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Mask (E,): whether triangles (E, 3) run along their edges (E, 2) from the first vertex to the second."""
    here = triangles[:, [[0, 1], [1, 2], [2, 0]]] == edges[:, None]
    return np.any(np.all(here, axis=2), axis=1)


def _filled(vertices: np.ndarray, triangles: np.ndarray, tiny: float) -> np.ndarray:
    """Fill holes of a surface that have three edges or fit into a box of ``tiny`` mm."""
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
    component = components(len(triangles), pairs)
    if component.max() > 0:
        area = np.bincount(component, np.linalg.norm(area_normals(vertices, triangles), axis=1))
        smallest = vertices[triangles[component == np.argmin(area)]].reshape(-1, 3)
        middle = place(0.5 * (smallest.min(axis=0) + smallest.max(axis=0)))
        raise GeometryError(
            f"it has {component.max() + 1} separate surfaces, the smallest around {middle}; one body without enclosed "
            "hollows is needed"
        )


def _check_crossings(vertices: np.ndarray, triangles: np.ndarray, tolerance: float) -> None:
    """Refuse triangles that an edge of another triangle pierces, by more than ``tolerance`` mm on all sides."""
    corners = vertices[triangles]
    blocks, compared = [np.arange(len(triangles))], 0
    while blocks:
        block = blocks.pop()
        try:
            first, second = _overlapping_boxes(corners, block)
        except TooManyPairs:
            blocks.extend(np.array_split(block, 8))
            continue
        compared += len(first)
        if compared > MOST_COMPARED:
            raise GeometryError("too many of its triangles lie across each other; repair the surface")
        _check_pairs(vertices, triangles, first, second, tolerance)


def _overlapping_boxes(corners: np.ndarray, block: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of triangles whose bounding boxes overlap: the numbers (P,) of the first triangles, which are in the
    ``block``, and (P,) of the second."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    first, second = overlapping(low[block], high[block], low, high)
    different = block[first] != second
    return block[first[different]], second[different]


def _check_pairs(
    vertices: np.ndarray, triangles: np.ndarray, first: np.ndarray, second: np.ndarray, tolerance: float
) -> None:
    corners = vertices[triangles]
    for start in range(0, len(first), CHUNK):
        edge_triangles, pierced_triangles = first[start : start + CHUNK], second[start : start + CHUNK]
        for k in range(3):
            ends = triangles[edge_triangles][:, [k, (k + 1) % 3]]
            disjoint = ~np.any(ends[:, :, None] == triangles[pierced_triangles][:, None], axis=(1, 2))
            through, points = _pierced(vertices[ends[disjoint]], corners[pierced_triangles[disjoint]], tolerance)
            if through.any():
                raise GeometryError(
                    f"its surface intersects itself at {place(points[np.argmax(through)])}; repair it there"
                )


def _pierced(segments: np.ndarray, corners: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Mask (N,): whether segments (N, 2, 3) pass through triangles (N, 3, 3), and where (N, 3) they meet their
    planes."""
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
    """Number of the face to which each triangle belongs: the triangle's own number or, for a very thin triangle
    (sliver), that of the neighbour across its longest edge.

    A sliver has no usable normal, but the surface would not be closed without it.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Returns
    -------
    (T,) ndarray of int
        Numbers of faces.
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
    """Whether a triangle is a sliver: its corners lie on a line, up to rounding.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Returns
    -------
    (T,) ndarray of bool
        One value for each triangle.
    """
    corners = vertices[triangles]
    longest = np.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2).max(axis=1)
    diagonal = np.linalg.norm(np.ptp(vertices, axis=0))
    return 2 * np.linalg.norm(area_normals(vertices, triangles), axis=1) <= WELD * diagonal * longest
