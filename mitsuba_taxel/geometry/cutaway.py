"""Closed surfaces cut open by a plane, with the face that the cut leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.geometry.triangles import half_edges

NUDGE = 1e-4
"""Of a surface's extent, how far the plane may be moved: planes of symmetry run along edges of many meshes, and nearer
to these than the rounding of single precision the surface is crumpled."""


@dataclass(frozen=True, eq=False)
class Half:
    """What a cut leaves of a surface.

    Attributes
    ----------
    vertices : ndarray
        (V, 3).
    triangles : (T, 3) ndarray
        Vertex numbers, counter-clockwise seen from outside.
    source : (T,) ndarray
        Number of the triangle of the whole surface that each is or is a part of, -1 on the face of the cut.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    source: np.ndarray


def is_closed(triangles: np.ndarray) -> bool:
    """Whether each edge of triangles (T, 3) is run through as often one way as the other."""
    edges, _ = half_edges(triangles)
    keys = edges.astype(np.int64) @ [int(triangles.max(initial=0)) + 1, 1]
    back = edges[:, ::-1].astype(np.int64) @ [int(triangles.max(initial=0)) + 1, 1]
    return bool(np.array_equal(np.sort(keys), np.sort(back)))


def cut_open(vertices: np.ndarray, triangles: np.ndarray, normal: np.ndarray, offset: float) -> Half:
    """The part of a surface where ``normal @ x > offset``; a closed one stays closed, by a flat face.

    The plane is moved by at most :data:`NUDGE` of the surface's extent, off the surface's vertices. The face is made
    of the polygons in which the plane meets the surface, and shares their vertices. A surface with holes is left open.

    Parameters
    ----------
    vertices : ndarray
        (V, 3).
    triangles : (T, 3) ndarray
        Counter-clockwise seen from outside if the surface is closed.
    normal : (3,) ndarray
        Of length 1.
    """
    height = vertices @ normal - offset
    height = height - _clear_of(height, NUDGE * np.ptp(vertices, axis=0).max(initial=0.0))
    above = height > 0
    crossed = np.flatnonzero(np.isin(above[triangles].sum(axis=1), (1, 2)))
    # Each is turned so that its first corner is alone on its side.
    inside = above[triangles[crossed]]
    alone = np.argmax(inside == (inside.sum(axis=1) == 1)[:, None], axis=1)
    a, b, c = (np.take_along_axis(triangles[crossed], (alone[:, None] + k) % 3, axis=1)[:, 0] for k in range(3))
    keys = np.sort(np.concatenate([np.stack([a, b], axis=1), np.stack([c, a], axis=1)]), axis=1)
    edges, number = np.unique(keys, axis=0, return_inverse=True)
    low, high = (height[edges[:, k], None] for k in (0, 1))
    points = (high * vertices[edges[:, 0]] - low * vertices[edges[:, 1]]) / (high - low)
    ab, ca = len(vertices) + number.reshape(2, -1)
    tip = above[a]
    whole = np.flatnonzero(above[triangles].all(axis=1))
    pieces = [
        (triangles[whole], whole),
        (np.stack([a, ab, ca], axis=1)[tip], crossed[tip]),
        (np.stack([ab, b, c], axis=1)[~tip], crossed[~tip]),
        (np.stack([ab, c, ca], axis=1)[~tip], crossed[~tip]),
    ]
    if len(points) and is_closed(triangles):
        rim = np.where(tip[:, None], np.stack([ca, ab], axis=1), np.stack([ab, ca], axis=1)) - len(vertices)
        face = triangulate(points @ _plane_axes(normal), _loops(rim)) + len(vertices)
        pieces.append((face, np.full(len(face), -1)))
    kept, sources = (np.concatenate(part) for part in zip(*pieces, strict=True))
    used, kept = np.unique(kept, return_inverse=True)
    return Half(np.concatenate([vertices, points])[used], kept.reshape(-1, 3), sources)


def triangulate(points: np.ndarray, loops: list[np.ndarray]) -> np.ndarray:
    """Triangles (T, 3), counter-clockwise, of the area inside polygons.

    By cutting off ears, after joining each hole to the polygon around it (D. Eberly, Triangulation by Ear Clipping,
    2002). Every edge of a polygon is that of one triangle; no point is added. n corners take about n² steps.

    Parameters
    ----------
    points : ndarray
        (N, 2).
    loops : list of ndarray
        Numbers (K,) of the corners of each polygon, which do not cross; holes run clockwise.
    """
    areas = [_area(points[loop]) for loop in loops]
    outlines = [loop for loop, area in zip(loops, areas, strict=True) if area >= 0]
    holes: list[list[np.ndarray]] = [[] for _ in outlines]
    for loop in (loop for loop, area in zip(loops, areas, strict=True) if area < 0):
        around = [k for k, outline in enumerate(outlines) if _contains(points[outline], points[loop[0]])]
        if around:  # else there is nothing to leave out
            holes[min(around, key=lambda k: _area(points[outlines[k]]))].append(loop)
    rings = [_joined(points, outline, inner) for outline, inner in zip(outlines, holes, strict=True)]
    return np.array([triangle for ring in rings for triangle in _ears(points, ring)], dtype=int).reshape(-1, 3)


def _clear_of(height: np.ndarray, reach: float) -> float:
    """The shift of a plane, between 0 and ``reach``, at which it stays furthest from all vertices."""
    near = height[(height > -reach) & (height < 2 * reach)]
    shifts = reach * np.linspace(0, 1, 17)
    gaps = [np.abs(near - shift).min(initial=np.inf) for shift in shifts]
    return float(shifts[np.argmax(gaps)])


def _plane_axes(normal: np.ndarray) -> np.ndarray:
    """(3, 2) two directions in a plane, counter-clockwise seen against ``normal``."""
    first = np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(first, normal)], axis=1)


def _loops(segments: np.ndarray) -> list[np.ndarray]:
    """The polygons that directed segments (S, 2) from point to point make; at each point as many end as begin."""
    following: dict[int, list[int]] = {}
    for start, end in segments.tolist():
        following.setdefault(start, []).append(end)
    loops = []
    for start in list(following):
        while following[start]:
            loop = [start]
            while (end := following[loop[-1]].pop()) != start:
                loop.append(end)
            loops.append(np.array(loop))
    return loops


def _area(polygon: np.ndarray) -> float:
    """Area inside a polygon (K, 2), negative if it runs clockwise."""
    x, y = (polygon - polygon[0]).T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _contains(polygon: np.ndarray, point: np.ndarray) -> bool:
    start, end = polygon - point, np.roll(polygon, -1, axis=0) - point
    crosses = (start[:, 1] > 0) != (end[:, 1] > 0)
    right = _cross(start[crosses], end[crosses]) * np.sign(end[crosses, 1] - start[crosses, 1]) > 0
    return bool(np.count_nonzero(right) % 2)


def _joined(points: np.ndarray, outline: np.ndarray, holes: list[np.ndarray]) -> np.ndarray:
    """One polygon round an area with holes: each hole is reached, and left again, by its shortest clear bridge."""
    ring, left = outline, list(holes)
    while left:
        edges = np.concatenate([np.stack([loop, np.roll(loop, -1)], axis=1) for loop in (ring, *left)])
        pairs = []
        for number, hole in enumerate(left):
            gaps = np.linalg.norm(points[ring][:, None] - points[hole], axis=2)
            pairs += [(gaps[i, j], number, i, j) for i, j in np.argwhere(gaps <= np.partition(gaps, 8, axis=None)[8])]
        clear = (pair for pair in sorted(pairs) if _is_clear(points, ring[pair[2]], left[pair[1]][pair[3]], edges))
        _, number, i, j = next(clear, min(pairs))
        hole = np.roll(left.pop(number), -j)
        ring = np.concatenate([ring[: i + 1], hole, hole[:1], ring[i:]])
    return ring


def _is_clear(points: np.ndarray, one: int, other: int, edges: np.ndarray) -> bool:
    """Whether the way between two points crosses none of the edges (E, 2) that do not end in one of them."""
    rest = edges[~np.isin(edges, (one, other)).any(axis=1)]
    p, q, a, b = points[one], points[other], points[rest[:, 0]], points[rest[:, 1]]
    apart = _cross(q - p, a - p) * _cross(q - p, b - p) > 0
    apart |= _cross(b - a, p - a) * _cross(b - a, q - a) > 0
    return bool(apart.all())


def _ears(points: np.ndarray, ring: np.ndarray) -> list[tuple[int, int, int]]:
    """Triangles of a polygon without holes, its corners' numbers (K,) counter-clockwise."""
    corner = points[ring]
    before, after = np.roll(np.arange(len(ring)), 1), np.roll(np.arange(len(ring)), -1)
    # Only a corner that is not convex can lie in an ear.
    blunt = _cross(corner - corner[before], corner[after] - corner) <= 0
    triangles, here, missed, left = [], 0, 0, len(ring)
    while left > 2:
        stuck = missed > left
        if stuck:  # on a polygon that touches itself by rounding
            here = _flattest(corner, before, after, here)
        i, k = before[here], after[here]
        if left == 3 or stuck or (not blunt[here] and _is_empty(corner[[i, here, k]], corner[blunt])):
            triangles.append((int(ring[i]), int(ring[here]), int(ring[k])))
            after[i], before[k] = k, i
            blunt[here] = False
            for end in (i, k):
                blunt[end] = _cross(corner[end] - corner[before[end]], corner[after[end]] - corner[end]) <= 0
            left, missed = left - 1, 0
        else:
            missed += 1
        here = k
    return triangles


def _flattest(corner: np.ndarray, before: np.ndarray, after: np.ndarray, start: int) -> int:
    """The corner, of those that are left, whose triangle is smallest."""
    left = [start]
    while (k := after[left[-1]]) != start:
        left.append(k)
    here = corner[left]
    return left[np.argmin(np.abs(_cross(here - corner[before[left]], corner[after[left]] - here)))]


def _is_empty(triangle: np.ndarray, points: np.ndarray) -> bool:
    """Whether none of the points (N, 2) lies in a triangle (3, 2) or on its edges; at its corners they may."""
    inside = ~(points[:, None] == triangle).all(axis=2).any(axis=1)
    for start, end in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
        inside &= _cross(end - start, points - start) >= 0
    return not inside.any()


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
