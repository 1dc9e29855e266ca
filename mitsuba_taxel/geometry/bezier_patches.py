"""Contact detection between curved triangles.

A six-node triangle is a quadratic Bezier patch and lies in the convex hull of its six control points. Two patches are
subdivided until a certificate proves that their pieces are disjoint, or until they are so flat that there is none.

A pair of patches is a column of 13 points: the control points of both, and a common origin, so that small pieces keep
their precision. Control points are in the order of the nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from scipy.linalg import block_diag

from mitsuba_taxel.geometry import quadratic_shapes
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES

BATCH = 64
"""Number of pairs that are subdivided together. The search is depth-first, which limits its memory and soon finds a
point of contact."""
FIRST_BATCH = 16384
"""Number of pairs that are tested together before any is subdivided."""
THIN = 1e-6
"""Twice the area of a triangle, relative to the square of its longest side, below which its normal is not reliable."""
STRICT = 1e-10
"""Distance from a plane through a common vertex, relative to the size of the patches, that exceeds rounding."""

Place = tuple[float, float, float]
"""Coordinates of a point in mm."""


def control_points(nodes: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Control points of curved triangles; those of edges lie off the surface.

    Parameters
    ----------
    nodes : (N, 3) ndarray
        Positions of the nodes in mm.
    faces : (B, 6) ndarray of int
        Nodes of each triangle: corners, then middles of edges.

    Returns
    -------
    (3, N) ndarray
        Control points in mm, numbered like the nodes.
    """
    control = nodes.copy()
    control[faces] = quadratic_shapes.control_points(nodes[faces])
    return control.T


def first_touch(first: np.ndarray, second: np.ndarray, shared: str, tolerance: float) -> Place | None:
    """A point at which the two curved patches of any of n pairs touch.

    Parameters
    ----------
    first, second : (4, 6, n) ndarray
        Control points of n pairs, in mm. The fourth coordinate is a function that says where contact counts: two points
        in contact count if it is positive at one of them.
    shared : str
        Common element of both partners, where they may meet: "nothing", "vertex" (their first corner) or "edge" (from
        their first to their second corner).
    tolerance : float
        Distance up to which patches count as touching, mm.

    Returns
    -------
    Place or None
        The first point that the search finds, in mm; None if there is none.
    """
    for start in range(0, first.shape[2], FIRST_BATCH):
        batch = slice(start, start + FIRST_BATCH)
        origin = first[:, :1, batch] * np.array([1, 1, 1, 0])[:, None, None]
        pairs = np.concatenate([first[:, :, batch] - origin, second[:, :, batch] - origin, origin], axis=1)
        position = _touch(pairs, shared, tolerance)
        if position:
            return position
    return None


def _touch(pairs: np.ndarray, shared: str, tolerance: float) -> Place | None:
    """A point of contact of n pairs of patches (4, 13, n), by depth-first subdivision."""
    waiting = [(shared, _doubtful(pairs, shared, tolerance))]
    while waiting:
        shared, pairs = waiting.pop()
        if pairs.shape[2] == 0:
            continue
        if pairs.shape[2] > BATCH:
            waiting.append((shared, pairs[:, :, BATCH:]))
            pairs = pairs[:, :, :BATCH]
        plain = _plain(pairs[:3], shared, tolerance)
        if plain.any():
            return _common_point(pairs[:3, :, plain.argmax()])
        if shared == "nothing":
            pairs = _first_to_cut(pairs, tolerance)
        for common, matrices in _CUTS[shared].items():
            pieces = np.tensordot(matrices, pairs, axes=(2, 1)).transpose(2, 1, 0, 3).reshape(4, 13, -1)
            waiting.append((common, _doubtful(pieces, common, tolerance)))
    return None


def _doubtful(pairs: np.ndarray, shared: str, tolerance: float) -> np.ndarray:
    """Select the pairs of patches that may touch: those for which a separating plane has not been found."""
    pairs = pairs[:, :, (pairs[3, :12] > 0).any(axis=0)]
    return pairs[:, :, ~_CERTIFICATES[shared](pairs[:3], tolerance)]


def _common_point(pair: np.ndarray) -> Place:
    """The point of the first patch of a pair of flat patches that is nearest to the second patch."""
    from scipy.optimize import nnls  # here, as a pad at rest does without

    corners, second_corners = pair[:, :3], pair[:, 6:9]
    size = max(np.abs(corners - second_corners[:, :1]).max(), np.finfo(float).tiny)
    equal = np.concatenate([corners - second_corners[:, :1], second_corners[:, :1] - second_corners], axis=1) / size
    sums = np.repeat(np.eye(2), 3, axis=1)
    weights, _ = nnls(np.concatenate([equal, sums]), np.array([0.0, 0.0, 0.0, 1.0, 1.0]))
    x, y, z = corners @ weights[:3] + pair[:, 12]
    return float(x), float(y), float(z)


def bulge(patches: np.ndarray) -> np.ndarray:
    """Distance by which curved patches deviate from their flat triangles: the largest over their control points.

    Parameters
    ----------
    patches : (3, 6, n) ndarray
        Coordinates of the control points of n patches, mm.

    Returns
    -------
    (n,) ndarray
        Distances in mm.
    """
    following = patches[:, [1, 2, 0]]
    return _length(patches[:, 3:] - (patches[:, :3] + following) / 2).max(axis=0)


def quarters(patches: np.ndarray) -> np.ndarray:
    """Patches subdivided into four each, by de Casteljau's algorithm.

    Parameters
    ----------
    patches : (k, 6, n) ndarray
        Control points, of k coordinates each, of n patches.

    Returns
    -------
    (k, 6, 4 n) ndarray
        Control points of the parts.
    """
    return np.tensordot(_QUARTERS, patches, axes=(2, 1)).transpose(2, 1, 0, 3).reshape(len(patches), 6, -1)


def _sides(patches: np.ndarray) -> np.ndarray:
    return patches[:, [1, 2, 0]] - patches[:, :3]


def _length(vectors: np.ndarray) -> np.ndarray:
    x, y, z = vectors
    return np.sqrt(x * x + y * y + z * z)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors; zero vectors stay 0."""
    return vectors / np.maximum(_length(vectors), np.finfo(float).tiny)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _plain(pairs: np.ndarray, shared: str, tolerance: float) -> np.ndarray:
    """Mask of the pairs that count as touching because they need no further subdivision: both patches are flat, or as
    small as a point.

    Flatness is absolute for patches that share nothing. For patches with a common vertex or edge it is relative to
    their size, as only angles matter.
    """
    plain = np.ones(pairs.shape[2], dtype=bool)
    for patches in (pairs[:, :6], pairs[:, 6:12]):
        side = _sides(patches)
        longest = _length(side).max(axis=0)
        if shared == "nothing":
            thin = _length(_cross(side[:, 0], side[:, 1])) <= THIN * longest**2
            flat = ~thin & (bulge(patches) <= tolerance)
        else:
            flat = bulge(patches) <= STRICT * longest
        plain &= flat | (longest <= tolerance)
    return plain


def _first_to_cut(pairs: np.ndarray, tolerance: float) -> np.ndarray:
    """Exchange the patches of each pair so that the patch to be subdivided comes first: the more curved one, or the
    longer one if both are flat."""
    first, second = pairs[:3, :6], pairs[:3, 6:12]
    first_bulge, second_bulge = bulge(first), bulge(second)
    longer = _length(_sides(first)).max(axis=0) < _length(_sides(second)).max(axis=0)
    flat = np.maximum(first_bulge, second_bulge) <= tolerance
    swap = np.where(flat, longer, first_bulge < second_bulge)
    return np.where(swap, pairs[:, [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5, 12]], pairs)


# ---- certificates that patches meet in their common vertex or edge only ----------------------------------------------


def _apart(pairs: np.ndarray, tolerance: float) -> np.ndarray:
    """Whether the two patches of each pair are separate: a plane lies between their control points, with a gap of more
    than ``tolerance``.

    Coordinate axes are tried first as normals of the plane, as they separate most pairs; then the normals of the
    separating axis theorem for flat triangles, so that no flat pair is missed.
    """
    low, high = (extreme(pairs[:, :12].reshape(3, 2, 6, -1), axis=2) for extreme in (np.min, np.max))
    separated = (np.maximum(low[:, 0] - high[:, 1], low[:, 1] - high[:, 0]) > tolerance).any(axis=0)
    for normals in (_face_normals, _side_normals):
        undecided = np.flatnonzero(~separated)
        first, second = pairs[:, :6, undecided], pairs[:, 6:12, undecided]
        axes = normals(first, second)
        a, b = (_dot(axes[:, :, None], points[:, None]) for points in (first, second))
        gap = np.maximum(a.min(axis=1) - b.max(axis=1), b.min(axis=1) - a.max(axis=1))
        separated[undecided] = (gap > tolerance * _length(axes)).any(axis=0)
    return separated


def _face_normals(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Normals (3, 3, n) of both flat triangles, and the vector between their centres."""
    between = second[:, :3].mean(axis=1) - first[:, :3].mean(axis=1)
    return np.stack([*(_cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) for p in (first, second)), between], axis=1)


def _side_normals(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Candidate directions (3, 15, n) for a plane that separates two flat triangles: normal to one side of each, and
    normal to a side and to the normal of the same triangle."""
    sides, second_sides = _sides(first), _sides(second)
    axes = [_cross(sides[:, :, None], second_sides[:, None]).reshape(3, 9, -1)]
    for side in (sides, second_sides):
        axes.append(_cross(_cross(side[:, :1], side[:, 1:2]), side))
    return np.concatenate(axes, axis=1)


def _apart_but_vertex(pairs: np.ndarray, tolerance: float) -> np.ndarray:
    """Whether the two patches of each pair touch only at their common vertex: a plane through it separates all other
    control points.
    """
    vertex = pairs[:, :1]
    first, second = pairs[:, 1:6] - vertex, pairs[:, 7:12] - vertex
    towards = [_unit(rays[:, :2].mean(axis=1)) for rays in (first, second)]
    separated = _divides(towards[1] - towards[0], first, second)
    undecided = np.flatnonzero(~separated)
    separated[undecided] = _divides(
        _middle_plane(first[:, :2, undecided], second[:, :2, undecided]),
        first[:, :, undecided],
        second[:, :, undecided],
    )
    return separated


def _divides(normal: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Whether a plane through the origin separates two sets of points: all ``first`` points are strictly behind it, all
    ``second`` points strictly in front of it."""
    size = np.maximum(_length(first).max(axis=0), _length(second).max(axis=0))
    limit = STRICT * size * _length(normal)
    return (_dot(normal[:, None], first).max(axis=0) < -limit) & (_dot(normal[:, None], second).min(axis=0) > limit)


def _middle_plane(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Normal (3, n) of a plane through the origin that separates two flat sectors. Each sector lies between two rays
    (3, 2, n).
    """
    first, second = (np.stack([_unit(rays[:, k]) for k in range(2)], axis=1) for rays in (first, second))
    candidates = [_cross(first[:, i], second[:, j]) for i, j in product(range(2), repeat=2)]
    for rays in (first, second):
        normal = _unit(_cross(rays[:, 0], rays[:, 1]))
        candidates += [normal, _cross(normal, rays[:, 0]), _cross(normal, rays[:, 1])]
    middle = np.zeros_like(first[:, 0])
    for candidate in map(_unit, candidates):
        a, b = _dot(candidate[:, None], first), _dot(candidate[:, None], second)
        forward = (a.max(axis=0) <= STRICT) & (b.min(axis=0) >= -STRICT)
        backward = (a.min(axis=0) >= -STRICT) & (b.max(axis=0) <= STRICT)
        middle += (forward.astype(float) - backward) * candidate
    return middle


def _apart_but_edge(pairs: np.ndarray, tolerance: float) -> np.ndarray:
    """Whether the two patches of each pair, which have a common edge, touch nowhere else. This is certain if both
    patches together can be projected one to one onto a plane.

    They are the image of a convex quadrilateral, cut by its diagonal, under a map f that is quadratic on both sides.
    With a projection P onto a plane, P f is one to one if its gradient has a positive definite symmetric part
    everywhere. The gradient is linear, so that it suffices to test the corners. The height of the quadrilateral is
    arbitrary.
    """
    first, second = pairs[:, :6], pairs[:, 6:12]
    along = _unit(first[:, 1] - first[:, 0])
    away = []
    for patch in (first, second):
        height = patch[:, 2] - patch[:, 0]
        away.append(_unit(height - _dot(height, along) * along))
    across = _unit(away[0] - away[1])
    return _unfolds(first, along, across) & _unfolds(second, along, -across)


def _unfolds(patch: np.ndarray, along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Whether the projection of a patch has a positive definite gradient at its corners, for some height h of the
    quadrilateral.

    With the derivatives (a, c) along the edge, of length 1, and (b, d) / h away from it, the condition is 4 a d / h >
    (b / h + c)^2. The height h = max |b| / max |c| satisfies it if a d > max |b| max |c|.
    """
    b0, b1, b2, b01, b12, b20 = (patch[:, k] for k in range(6))
    edge = 2 * np.stack([b01 - b0, b1 - b01, b12 - b20], axis=1)
    rise = 2 * np.stack([b20 - b0, b12 - b01, b2 - b20], axis=1) - edge / 2
    edge = edge / np.maximum(_length(b1 - b0), np.finfo(float).tiny)
    along, across = along[:, None], across[:, None]
    a, c = _dot(along, edge), _dot(across, edge)
    b, d = _dot(along, rise), _dot(across, rise)
    folded = (a.min(axis=0) <= 0) | (d.min(axis=0) <= STRICT * _length(rise).max(axis=0))
    return ~folded & (a.min(axis=0) * d.min(axis=0) > np.abs(b).max(axis=0) * np.abs(c).max(axis=0))


_CERTIFICATES: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "nothing": _apart,
    "vertex": _apart_but_vertex,
    "edge": _apart_but_edge,
}


# ---- subdivision -----------------------------------------------------------------------------------------------------


def _piece(*corners: np.ndarray) -> np.ndarray:
    """Matrix (6, 6) from the control points of a patch to those of its piece between three barycentric corners.

    It follows from the blossom of the patch.
    """
    ends = [(p, p) for p in corners] + [(corners[i], corners[j]) for i, j in FACE_EDGES]
    product_of = [np.outer(p, q) for p, q in ends]
    return np.array([[*np.diag(m), *(m[i, j] + m[j, i] for i, j in FACE_EDGES)] for m in product_of])


_V0, _V1, _V2 = np.eye(3)
_M01, _M12, _M20 = (_V0 + _V1) / 2, (_V1 + _V2) / 2, (_V2 + _V0) / 2
_QUARTERS = np.array(
    [_piece(_V0, _M01, _M20), _piece(_V1, _M12, _M01), _piece(_V2, _M20, _M12), _piece(_M01, _M12, _M20)]
)
_HALVES_OF_EDGE = [_piece(_V0, _M01, _M20), _piece(_M01, _V1, _M12)]
_ROUND_MIDDLE = [_piece(_M01, _M20, _V0), _piece(_M01, _V1, _M12), _piece(_M01, _M12, _M20)]


def _pairs(pieces: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    return np.array([block_diag(first, second, np.eye(1)) for first, second in pieces])


_CUTS = {
    "nothing": {"nothing": _pairs([(piece, np.eye(6)) for piece in _QUARTERS])},
    "vertex": {
        "nothing": _pairs(list(product(_QUARTERS, repeat=2))[1:]),
        "vertex": _pairs([(_QUARTERS[0], _QUARTERS[0])]),
    },
    "edge": {
        "nothing": _pairs(
            [(first, second) for i, first in enumerate(_QUARTERS) for j, second in enumerate(_QUARTERS) if 2 in (i, j)]
        ),
        "vertex": _pairs(
            [(_ROUND_MIDDLE[i], _ROUND_MIDDLE[j]) for i, j in product(range(3), repeat=2) if i != j or i == 2]
        ),
        "edge": _pairs([(half, half) for half in _HALVES_OF_EDGE]),
    },
}
