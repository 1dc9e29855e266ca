"""Removal of degenerate triangles from a closed mesh, which stays closed."""

from __future__ import annotations

import numpy as np

SHORT = 1e-7
"""Distance in mm below which vertices coincide."""
FLAT = 1e-12
"""Height in mm below which a triangle is degenerate: far below SHORT, so that the pieces of a triangle are not
degenerate again."""
MOST_ROUNDS = 100
"""Largest number of rounds, of which seven are usual; slivers that remain are harmless."""


def without_slivers(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangles of a closed mesh without degenerate ones, and their original numbers.

    Coincident vertices are merged. A triangle whose corner lies on its longest side is removed by flipping that side,
    which splits the triangle beyond it at that corner.

    Parameters
    ----------
    points : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Returns
    -------
    triangles : (S, 3) ndarray of int
        Vertices of each triangle.
    number : (S,) ndarray of int
        Original number of each triangle.
    """
    origin = np.arange(len(triangles))
    for _ in range(MOST_ROUNDS):
        side = np.linalg.norm(points[triangles] - points[np.roll(triangles, -1, axis=1)], axis=2)
        if (side < SHORT).any():
            triangles, kept = _merged(triangles, side < SHORT, len(points))
            origin = origin[kept]
            continue
        a, b, c = (points[triangles[:, k]] for k in range(3))
        flat = np.linalg.norm(np.cross(b - a, c - a), axis=1) < FLAT * side.max(axis=1)
        if not flat.any():
            break
        triangles, origin = _exchanged(triangles, origin, flat, side.argmax(axis=1), side.max(axis=1))
    return triangles, origin


def _merged(triangles: np.ndarray, short: np.ndarray, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Merge the two ends of each side marked in ``short`` (T, 3). Returns the triangles, and a mask of those that
    remain."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    row, k = np.nonzero(short)
    start, end = triangles[row, k], triangles[row, (k + 1) % 3]
    graph = coo_array((np.ones(len(start)), (start, end)), shape=(vertices, vertices))
    label = connected_components(graph, directed=False)[1]
    first = np.full(label.max() + 1, vertices)
    np.minimum.at(first, label, np.arange(vertices))
    merged = first[label][triangles]
    kept = np.flatnonzero((merged != np.roll(merged, 1, axis=1)).all(axis=1))
    kept = kept[_without_pairs(merged[kept])]
    return merged[kept], kept


def _without_pairs(triangles: np.ndarray) -> np.ndarray:
    """Mask of the triangles that remain when pairs of triangles with the same corners but opposite orientations are
    removed."""
    corners = np.sort(triangles, axis=1)
    order = np.lexsort(corners.T)
    same = np.zeros(len(order) + 1, dtype=bool)
    same[1:-1] = (corners[order[1:]] == corners[order[:-1]]).all(axis=1)
    return np.sort(order[~(same[1:] | same[:-1])])


def _exchanged(
    triangles: np.ndarray, origin: np.ndarray, flat: np.ndarray, longest: np.ndarray, length: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Flip the longest sides of ``flat`` triangles, at most one side of any triangle at a time.

    If several sides belong to one triangle, the longest is flipped first.
    """
    rows = np.flatnonzero(flat)
    rows = rows[np.argsort(-length[rows], kind="stable")]
    k = longest[rows]
    a, b, c = (triangles[rows, (k + j) % 3] for j in range(3))
    beyond, opposite = _neighbours(triangles, a, b)
    rank = np.arange(len(rows))
    first = np.full(len(triangles), len(rows))
    np.minimum.at(first, rows, rank)
    np.minimum.at(first, beyond, rank)
    free = (first[rows] == rank) & (first[beyond] == rank)
    rows, beyond, opposite, a, b, c = (values[free] for values in (rows, beyond, opposite, a, b, c))
    triangles, origin = triangles.copy(), origin.copy()
    triangles[rows] = np.stack([a, opposite, c], axis=1)
    triangles[beyond] = np.stack([opposite, b, c], axis=1)
    origin[rows] = origin[beyond]
    return triangles, origin


def _neighbours(triangles: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (S,) across the directed sides (a, b), which contain the side in the opposite direction (b, a), and
    their third corners (S,)."""
    size = int(triangles.max()) + 1
    sides = triangles.astype(np.int64) * size + np.roll(triangles, -1, axis=1)
    opposite_sides = b.astype(np.int64) * size + a
    candidates = np.flatnonzero(np.isin(sides, opposite_sides).ravel())
    candidates = candidates[np.argsort(sides.ravel()[candidates])]
    matching = candidates[np.searchsorted(sides.ravel()[candidates], opposite_sides)]
    row, k = np.divmod(matching, 3)
    return row, triangles[row, (k + 2) % 3]
