"""Triangulation of plane polygons with holes by ear clipping (D. Eberly, Triangulation by ear clipping, 2002)."""

from __future__ import annotations

import numpy as np


class NotSimple(Exception):
    """Edges that do not form polygons, or polygons that touch themselves or each other."""


def triangulated(points: np.ndarray, edges: np.ndarray, strict: bool = True) -> np.ndarray:
    """Counter-clockwise triangles (T, 3) of the area to the left of directed ``edges`` (E, 2).

    The edges form closed loops: counter-clockwise round areas, clockwise round their holes. Every edge belongs to one
    triangle; no vertex is added. The cost is O(n²) for n corners.

    Parameters
    ----------
    points : ndarray
        (N, 2).
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
    triangles = [_ears(points, _bridged(points, *parts, strict), strict) for parts in zip(outer, holes, strict=True)]
    return np.concatenate(triangles) if triangles else np.empty((0, 3), dtype=np.int64)


def _loops(edges: np.ndarray, strict: bool) -> list[np.ndarray]:
    """The polygons formed by edges; if ``strict``, only one may pass through each vertex."""
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
    """One loop round an area and its holes, joined by bridges that are run along twice."""
    loop = outer
    for hole in sorted(holes, key=lambda h: -points[h, 0].max()):
        start = int(points[hole, 0].argmax())
        hole = np.roll(hole, -start)
        near = np.argsort(np.linalg.norm(points[loop] - points[hole[0]], axis=1), kind="stable")
        for at in near:
            if _free(points, loop, holes, hole[0], int(loop[at])) and _in_corner(points, loop, int(at), hole[0]):
                break
        else:
            at = _unless(strict, near[0])
        loop = np.concatenate([loop[: at + 1], hole, hole[:1], loop[at:]])
    return loop


def _free(points: np.ndarray, loop: np.ndarray, holes: list[np.ndarray], one: int, other: int) -> bool:
    """Whether the segment between two vertices meets edges only at its ends."""
    starts = np.concatenate([loop, *holes])
    ends = np.concatenate([np.roll(loop, -1), *(np.roll(hole, -1) for hole in holes)])
    a, b = points[one], points[other]
    apart = ~np.isin(starts, (one, other)) & ~np.isin(ends, (one, other))
    p, q = points[starts[apart]], points[ends[apart]]
    return not np.any((_turn(a, b, p) * _turn(a, b, q) <= 0) & (_turn(p, q, a) * _turn(p, q, b) <= 0))


def _in_corner(points: np.ndarray, loop: np.ndarray, at: int, vertex: int) -> bool:
    """Whether a vertex lies within the angle of a corner of a loop."""
    before, here, after = points[loop[at - 1]], points[loop[at]], points[loop[(at + 1) % len(loop)]]
    left, right = _turn(here, after, points[vertex]) > 0, _turn(before, here, points[vertex]) > 0
    return bool(left and right) if _turn(before, here, after) > 0 else bool(left or right)


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the area of triangles, positive if counter-clockwise."""
    a, b, c = np.asarray(a), np.asarray(b), np.asarray(c)
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])


def _unless(strict: bool, makeshift: int) -> int:
    """A fallback where no choice is valid; raises `NotSimple` if ``strict``."""
    if strict:
        raise NotSimple
    return makeshift


def _ears(points: np.ndarray, loop: np.ndarray, strict: bool) -> np.ndarray:
    triangles = []
    left = loop.tolist()
    while len(left) > 3:
        nodes = np.array(left)
        a, b, c = points[np.roll(nodes, 1)], points[nodes], points[np.roll(nodes, -1)]
        area = _turn(a, b, c)
        sides = sum(((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))
        shape = area / np.where(sides > 0, sides, 1.0)
        for ear in np.argsort(-shape, kind="stable"):
            if shape[ear] <= 1e-9:
                ear = _unless(strict, np.abs(area).argmin())
                break
            others = points[nodes[~np.isin(nodes, (nodes[ear - 1], nodes[ear], nodes[(ear + 1) % len(nodes)]))]]
            within = (
                (_turn(a[ear], b[ear], others) >= 0)
                & (_turn(b[ear], c[ear], others) >= 0)
                & (_turn(c[ear], a[ear], others) >= 0)
            )
            if not within.any():
                break
        else:
            ear = _unless(strict, np.abs(area).argmin())
        triangles.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
    if strict and _turn(*points[left]) <= 0:
        raise NotSimple
    return np.array([*triangles, left], dtype=np.int64)
