"""Triangulation of plane polygons with holes by ear clipping (D. Eberly, Triangulation by ear clipping, 2002)."""

from __future__ import annotations

import numpy as np


class NotSimple(Exception):
    """Edges do not form simple polygons: they are not closed, or polygons touch themselves or each other."""


def triangulated(points: np.ndarray, edges: np.ndarray, strict: bool = True) -> np.ndarray:
    """Counter-clockwise triangles of the area to the left of directed edges.

    The edges form closed loops: counter-clockwise around areas, clockwise around their holes. Every edge belongs to one
    triangle, and no vertex is added. The cost is O(n²) for n corners.

    Parameters
    ----------
    points : (N, 2) ndarray
        Positions of the vertices.
    edges : (E, 2) ndarray of int
        Start and end of each edge.
    strict : bool
        Whether loops that touch or cross are refused; otherwise triangles may be degenerate or inverted.

    Returns
    -------
    (T, 3) ndarray of int
        Points of each triangle.

    Raises
    ------
    NotSimple
        if loops touch or cross.
    """
    loops = _loops(edges, strict)
    areas = [_area(points[loop]) for loop in loops]
    outer = [loop for loop, area in zip(loops, areas, strict=True) if area >= 0]
    holes: list[list[np.ndarray]] = [[] for _ in outer]
    for hole in (loop for loop, area in zip(loops, areas, strict=True) if area < 0):
        around = [k for k, loop in enumerate(outer) if _inside(points[hole[0]], points[loop])]
        if around:
            holes[min(around, key=lambda k: _area(points[outer[k]]))].append(hole)
        elif strict:
            raise NotSimple
    triangles = [
        _ears(points, _bridged(points, *areas_and_holes, strict), strict)
        for areas_and_holes in zip(outer, holes, strict=True)
    ]
    return np.concatenate(triangles) if triangles else np.empty((0, 3), dtype=np.int64)


def _loops(edges: np.ndarray, strict: bool) -> list[np.ndarray]:
    """The polygons that edges (E, 2) form, as vertices in order. If ``strict``, each vertex may belong to one polygon
    only."""
    following: dict[int, list[int]] = {}
    for start, end in edges.tolist():
        following.setdefault(start, []).append(end)
    if strict and (len(following) < len(edges) or set(following) != set(edges[:, 1].tolist())):
        raise NotSimple
    loops = []
    for start in reversed(list(following)):
        while following[start]:
            loop = [start]
            while (end := following[loop[-1]].pop()) != start:
                loop.append(end)
            loops.append(np.array(loop))
    return loops


def _area(corners: np.ndarray) -> float:
    x, y = (corners - corners[0]).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _inside(point: np.ndarray, corners: np.ndarray) -> bool:
    start, end = corners, np.roll(corners, -1, axis=0)
    across = (start[:, 1] > point[1]) != (end[:, 1] > point[1])
    start, end = start[across], end[across]
    x = start[:, 0] + (point[1] - start[:, 1]) / (end[:, 1] - start[:, 1]) * (end[:, 0] - start[:, 0])
    return bool(np.count_nonzero(x > point[0]) % 2)


def _bridged(points: np.ndarray, outer: np.ndarray, holes: list[np.ndarray], strict: bool) -> np.ndarray:
    """A single loop around an area and its holes, joined by bridges that the loop passes in both directions."""
    loop = outer
    for hole in sorted(holes, key=lambda h: -points[h, 0].max()):
        start = int(points[hole, 0].argmax())
        hole = np.roll(hole, -start)
        nearest = np.argsort(np.linalg.norm(points[loop] - points[hole[0]], axis=1), kind="stable")
        for at in nearest:
            if _free(points, loop, holes, hole[0], int(loop[at])) and _in_corner(points, loop, int(at), hole[0]):
                break
        else:
            at = _unless(strict, nearest[0])
        loop = np.concatenate([loop[: at + 1], hole, hole[:1], loop[at:]])
    return loop


def _free(points: np.ndarray, loop: np.ndarray, holes: list[np.ndarray], first: int, second: int) -> bool:
    """Whether no edge crosses the segment between the vertices ``first`` and ``second``, except at its ends."""
    starts = np.concatenate([loop, *holes])
    ends = np.concatenate([np.roll(loop, -1), *(np.roll(hole, -1) for hole in holes)])
    a, b = points[first], points[second]
    separate = ~np.isin(starts, (first, second)) & ~np.isin(ends, (first, second))
    p, q = points[starts[separate]], points[ends[separate]]
    return not np.any((_turn(a, b, p) * _turn(a, b, q) <= 0) & (_turn(p, q, a) * _turn(p, q, b) <= 0))


def _in_corner(points: np.ndarray, loop: np.ndarray, at: int, vertex: int) -> bool:
    """Whether a vertex lies inside the angle that a loop forms at one of its corners."""
    before, here, after = points[loop[at - 1]], points[loop[at]], points[loop[(at + 1) % len(loop)]]
    inside_next, inside_previous = _turn(here, after, points[vertex]) > 0, _turn(before, here, points[vertex]) > 0
    is_convex = _turn(before, here, after) > 0
    return bool(inside_next and inside_previous) if is_convex else bool(inside_next or inside_previous)


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the signed area of triangles with the corners a, b and c; positive if they are counter-clockwise."""
    a, b, c = np.asarray(a), np.asarray(b), np.asarray(c)
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])


def _unless(strict: bool, makeshift: int) -> int:
    """Return ``makeshift``, a provisional result, for loops that allow no valid triangulation; raises `NotSimple` if
    ``strict``.
    """
    if strict:
        raise NotSimple
    return makeshift


def _ears(points: np.ndarray, loop: np.ndarray, strict: bool) -> np.ndarray:
    """Triangles (T, 3) of a loop by ear clipping; the best-shaped ear that contains no other corner is cut off
    first."""
    triangles = []
    remaining = loop.tolist()
    while len(remaining) > 3:
        nodes = np.array(remaining)
        a, b, c = points[np.roll(nodes, 1)], points[nodes], points[np.roll(nodes, -1)]
        area = _turn(a, b, c)
        sides = sum(((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))
        shape = area / np.where(sides > 0, sides, 1.0)
        for ear in np.argsort(-shape, kind="stable"):
            if shape[ear] <= 1e-9:
                ear = _unless(strict, np.abs(area).argmin())
                break
            candidates = points[nodes[~np.isin(nodes, (nodes[ear - 1], nodes[ear], nodes[(ear + 1) % len(nodes)]))]]
            within = (
                (_turn(a[ear], b[ear], candidates) >= 0)
                & (_turn(b[ear], c[ear], candidates) >= 0)
                & (_turn(c[ear], a[ear], candidates) >= 0)
            )
            if not within.any():
                break
        else:
            ear = _unless(strict, np.abs(area).argmin())
        triangles.append([remaining[ear - 1], remaining[ear], remaining[(ear + 1) % len(remaining)]])
        del remaining[ear]
    if strict and _turn(*points[remaining]) <= 0:
        raise NotSimple
    return np.array([*triangles, remaining], dtype=np.int64)
