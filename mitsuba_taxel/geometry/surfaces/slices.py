"""Slicing of triangles by equidistant parallel planes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SNAP = 1e-4
"""Vertices closer to a plane than this, relative to the spacing of the planes, count as lying on it."""


@dataclass(frozen=True)
class Slices:
    """A mesh sliced by planes.

    Attributes
    ----------
    low, high, fraction : (V,) ndarray
        The two vertices of the original mesh between which a vertex lies, and its relative distance from the first.
    height : (V,) ndarray
        Height of each vertex, in units of the planes' spacing; a whole number on a plane.
    triangles : (T, 3) ndarray
        Vertex numbers; the vertices of the mesh keep theirs.
    parents : (T,) ndarray
        Number of the original triangle that contains each triangle.
    band : (T,) ndarray
        Number of the plane below each piece of a chosen triangle.
    """

    low: np.ndarray
    high: np.ndarray
    fraction: np.ndarray
    height: np.ndarray
    triangles: np.ndarray
    parents: np.ndarray
    band: np.ndarray


def sliced(height: np.ndarray, triangles: np.ndarray, chosen: np.ndarray) -> Slices:
    """Cut triangles along the planes at which a height is a whole number; the height is linear on each triangle.

    Triangles that are not chosen are split only where they share an edge with a chosen one, so that a closed mesh stays
    closed. A triangle that lies in a plane belongs to the band above it.

    Parameters
    ----------
    height : (V,) ndarray
        Height of each vertex, in units of the distance between planes.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    chosen : (T,) ndarray of bool
        Whether each triangle is cut.

    Returns
    -------
    Slices
        The pieces, with their vertices expressed by the given vertices.
    """
    rounded = np.rint(height)
    height = np.where(np.abs(height - rounded) < SNAP, rounded, height)
    crossings = _Crossings(height)
    inner = np.flatnonzero(chosen)
    pieces, parents, band = _bands(height, triangles[inner], crossings)
    outer = np.flatnonzero(~chosen)
    split, sources = _split_beside(height, triangles[outer], triangles[inner], crossings)
    pieces, low, high, plane = crossings.resolve(np.concatenate([pieces, split]))
    proper = (pieces != np.roll(pieces, 1, axis=1)).all(axis=1)

    fraction = (plane - height[low]) / (height[high] - height[low])
    own, zeros = np.arange(len(height)), np.zeros(len(height))
    return Slices(
        np.concatenate([own, low]),
        np.concatenate([own, high]),
        np.concatenate([zeros, fraction]),
        np.concatenate([height, plane]),
        pieces[proper],
        np.concatenate([inner[parents], outer[sources]])[proper],
        np.concatenate([band, np.zeros(len(sources), dtype=np.int64)])[proper],
    )


class _Crossings:
    """Numbering of the points where edges meet planes, shared by all triangles at an edge."""

    def __init__(self, height: np.ndarray) -> None:
        self.height = height
        self.first_plane = int(np.floor(height.min()))
        self.planes = int(np.ceil(height.max())) - self.first_plane + 1

    def between(self, low: np.ndarray, high: np.ndarray, plane: np.ndarray) -> np.ndarray:
        """Numbers of the points where edges from ``low`` up to ``high`` meet a plane. It is the number of a vertex if
        one lies there; new points have the number -1 - key until :meth:`resolve` numbers them.
        """
        key = (low * len(self.height) + high) * self.planes + (plane - self.first_plane)
        inside = np.where(plane >= self.height[high], high, -1 - key)
        return np.where(plane <= self.height[low], low, inside)

    def resolve(self, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Replace the keys of new points in triangles ``pieces`` by vertex numbers; also returns lower end, upper end
        and plane of each new vertex.
        """
        new = pieces < 0
        keys, number = np.unique(-1 - pieces[new], return_inverse=True)
        pieces = pieces.copy()
        pieces[new] = len(self.height) + number
        edge, plane = np.divmod(keys, self.planes)
        low, high = np.divmod(edge, len(self.height))
        return pieces, low, high, plane + self.first_plane


def _bands(
    height: np.ndarray, triangles: np.ndarray, crossings: _Crossings
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut triangles along the planes; returns the pieces, their original triangles, and the number of the plane below
    each."""
    order = np.argsort(height[triangles], axis=1, kind="stable")
    turned = (order[:, 1] - order[:, 0]) % 3 == 2
    corners = np.take_along_axis(triangles, order, axis=1).astype(np.int64)
    lowest, highest = height[corners[:, 0]], height[corners[:, 2]]
    first = np.floor(lowest).astype(np.int64)
    count = np.maximum(np.ceil(highest).astype(np.int64) - first, 1)
    parents, step = _repeated(count)
    low, middle, high = corners[parents].T
    band = first[parents] + step

    def on_long_side(plane: np.ndarray) -> np.ndarray:
        return crossings.between(low, high, plane)

    def on_short_sides(plane: np.ndarray) -> np.ndarray:
        below = plane < height[middle]
        return crossings.between(np.where(below, low, middle), np.where(below, middle, high), plane)

    long_side, short_sides = (
        (on_long_side(band), on_long_side(band + 1)),
        (on_short_sides(band), on_short_sides(band + 1)),
    )
    # A piece without the middle corner is a quadrilateral: its upper right corner takes the middle's place.
    apex = np.where((band < height[middle]) & (height[middle] < band + 1), middle, short_sides[1])
    triangles_between = [
        (long_side[0], short_sides[0], apex),
        (long_side[0], apex, long_side[1]),
        (apex, short_sides[1], long_side[1]),
    ]
    pieces = np.concatenate([np.stack(piece, axis=1) for piece in triangles_between])
    flip = np.tile(turned[parents], 3)
    pieces[flip] = pieces[flip][:, ::-1]
    return pieces, np.tile(parents, 3), np.tile(band, 3)


def _split_beside(
    height: np.ndarray, triangles: np.ndarray, cut: np.ndarray, crossings: _Crossings
) -> tuple[np.ndarray, np.ndarray]:
    """Split the triangles beside the ``cut`` triangles: their shared edges are divided at the planes. Returns the
    pieces and the original triangle of each."""
    triangles = triangles.astype(np.int64)
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
    ends = np.sort(height[edges], axis=2)
    planes = np.ceil(ends[..., 1]) - np.floor(ends[..., 0]) - 1
    beside = np.isin(_edge_keys(triangles, len(height)), _edge_keys(cut, len(height)))
    count = np.where(beside, np.maximum(planes, 0), 0).astype(np.int64)
    assert (np.count_nonzero(count, axis=1) <= 1).all(), "a triangle shares two sides with triangles that are cut"
    side = count.argmax(axis=1)
    rows = np.arange(len(triangles))
    a, b, apex = (triangles[rows, (side + k) % 3] for k in range(3))
    sources, step = _repeated(count[rows, side] + 1)
    a, b, apex = a[sources], b[sources], apex[sources]
    rising = height[a] <= height[b]
    low, high = np.where(rising, a, b), np.where(rising, b, a)
    start = np.where(rising, np.floor(height[a]), np.ceil(height[a])).astype(np.int64)
    direction = np.where(rising, 1, -1)
    last = step == count[sources, side[sources]]

    def along(number: np.ndarray) -> np.ndarray:
        return crossings.between(low, high, start + direction * number)

    return np.stack([along(step), np.where(last, b, along(step + 1)), apex], axis=1), sources


def _edge_keys(triangles: np.ndarray, vertices: int) -> np.ndarray:
    """Integer key (T, 3) of each edge of T triangles; both directions of an edge have the same key."""
    ends = triangles.astype(np.int64), np.roll(triangles, -1, axis=1).astype(np.int64)
    return np.minimum(*ends) * vertices + np.maximum(*ends)


def _repeated(count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Repeat row i ``count[i]`` times. Returns the numbers of the rows, and the index of each repetition, from 0."""
    rows = np.repeat(np.arange(len(count)), count)
    return rows, np.arange(len(rows)) - np.repeat(np.cumsum(count) - count, count)
