"""Isotropic remeshing of a surface of triangles to given local sizes.

Edges are split, collapsed and flipped, and vertices moved along the surface, until lengths fit (M. Botsch and L.
Kobbelt, A remeshing approach to multiresolution modeling, 2004). Borders and corners of patches are preserved.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mitsuba_taxel.geometry.surfaces.triangles import area_normals, half_edges, neighbours, subdivided, unit
from mitsuba_taxel.pads.imported.triangles.snapping import CREASE_ANGLE, Patches

LONGEST, SHORTEST = 4 / 3, 4 / 5
"""Lengths, relative to the target size, beyond which an edge is split or collapsed."""
MOST_TURN = math.cos(math.radians(40.0))
"""Least cosine between the normal of a new triangle and those of the surface at its corners."""
GOOD = 0.3
"""Least quality of a triangle (1 if equilateral) after a collapse, unless it was worse before."""
ROUNDS = 8
MOST_COLLAPSES, FLIPS = 200, 6
"""Largest numbers of rounds of independent collapses and flips."""
REACH = 0.75
"""Largest distance of a vertex from the patch onto which it is projected, relative to the local size."""


def remeshed(
    patches: Patches, size: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Remesh a surface to local sizes.

    Parameters
    ----------
    patches : Patches
        Patches of the surface.
    size : Callable
        Returns the target length (N,) of edges in mm at points (N, 3), on the patches given by ``belongs`` (N,
        patches).

    Returns
    -------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    patch : (T,) ndarray of int
        Patch of each triangle.
    """
    surface = _Surface(patches, size)
    surface.collapse(MOST_COLLAPSES)
    for _ in range(ROUNDS):
        surface.split()
        surface.flip()
        surface.collapse(MOST_COLLAPSES)
        surface.flip()
        surface.smooth()
    used, triangles = np.unique(surface.triangles, return_inverse=True)
    return surface.points[used], triangles.reshape(-1, 3), surface.patch


class _Surface:
    """The surface during remeshing; removed vertices stay in ``points``."""

    def __init__(self, patches: Patches, size: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> None:
        self.patches, self._size = patches, size
        self.points, self.triangles, self.patch = patches.vertices.copy(), patches.triangles, patches.patch
        self.fixed = self._kinks()

    def _kinks(self) -> np.ndarray:
        """Mask (V,) of the vertices at corners of patches, or at kinks of a border."""
        fixed = np.zeros(len(self.points), dtype=bool)
        fixed[self.patches.corners] = True
        ends = np.concatenate([self.patches.curves, self.patches.curves[:, ::-1]])
        along = unit(self.points[ends[:, 1]] - self.points[ends[:, 0]])
        total = np.zeros_like(self.points)
        np.add.at(total, ends[:, 0], along)
        count = np.bincount(ends[:, 0], minlength=len(self.points))
        # The sum of two unit vectors at an angle of 180 - a degrees has the length 2 sin(a / 2).
        bent = np.linalg.norm(total, axis=1) > 2 * math.sin(math.radians(0.5 * CREASE_ANGLE))
        return fixed | (count == 1) | (count > 2) | ((count == 2) & bent)

    @property
    def belongs(self) -> np.ndarray:
        belongs = np.zeros((len(self.points), self.patches.count), dtype=bool)
        belongs[self.triangles.ravel(), np.repeat(self.patch, 3)] = True
        return belongs

    @property
    def size(self) -> np.ndarray:
        """Target length (V,) of edges at each vertex; infinite for removed vertices."""
        result = np.full(len(self.points), np.inf)
        used = np.unique(self.triangles)
        result[used] = self._size(self.points[used], self.belongs[used])
        return result

    def _edges(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The E edges (E, 2), their two triangles (E, 2), and a mask (E,) of those on a border."""
        edges, pairs = neighbours(self.triangles)
        return edges, pairs, self.patch[pairs[:, 0]] != self.patch[pairs[:, 1]]

    # -- Long edges ---------------------------------------------------------------------------------------------------
    def split(self) -> None:
        edges, pairs, border = self._edges()
        size = self.size
        length = np.linalg.norm(self.points[edges[:, 0]] - self.points[edges[:, 1]], axis=1)
        long = length > LONGEST * size[edges].min(axis=1)
        if not long.any():
            return
        edges = edges[long]
        midpoints = len(self.points) + np.arange(len(edges))
        key = _keys(edges, len(self.points))  # ascending, as the edges are
        side_keys = _keys(np.sort(half_edges(self.triangles)[0], axis=1), len(self.points))
        at = np.minimum(np.searchsorted(key, side_keys), len(key) - 1)
        middle = np.where(key[at] == side_keys, midpoints[at], -1).reshape(-1, 3)
        self.points = np.concatenate([self.points, self.points[edges].mean(axis=1)])
        self.fixed = np.concatenate([self.fixed, np.zeros(len(edges), dtype=bool)])
        self.triangles, parent = subdivided(self.points, self.triangles, middle)
        self.patch = self.patch[parent]
        self._project(midpoints, size[edges].min(axis=1))

    def _project(self, nodes: np.ndarray, size: np.ndarray) -> None:
        """Project vertices onto the patches or borders that they belong to, unless that inverts a triangle."""
        belongs = self.belongs[nodes]
        reach = REACH * float(size.max())
        projected = self.patches.onto_surface(self.points[nodes], belongs, reach)
        self._move(nodes, self.patches.onto_features(projected, belongs, reach))

    def _move(self, nodes: np.ndarray, positions: np.ndarray) -> None:
        before = self.points.copy()
        normals, quality = unit(area_normals(before, self.triangles)), _quality(before[self.triangles])
        self.points[nodes] = positions
        while True:
            inverted = np.einsum("ij,ij->i", unit(area_normals(self.points, self.triangles)), normals) < MOST_TURN
            inverted |= _quality(self.points[self.triangles]) < np.minimum(0.5 * GOOD, quality)
            reverted = np.unique(self.triangles[inverted])
            reverted = reverted[np.any(self.points[reverted] != before[reverted], axis=1)]
            if not len(reverted):
                return
            self.points[reverted] = before[reverted]

    # -- Short edges --------------------------------------------------------------------------------------------------
    def collapse(self, rounds: int) -> None:
        """Collapse short edges: merge vertices into a neighbour."""
        random = np.random.default_rng(0)
        idle = 0
        for _ in range(rounds):
            count = len(self.triangles)
            self._collapse_once(random)
            idle = idle + 1 if len(self.triangles) > 0.998 * count else 0
            if idle > 2:
                return

    def _collapse_once(self, random: np.random.Generator) -> None:
        edges, _, border = self._edges()
        size = self.size
        directed = np.concatenate([edges, edges[:, ::-1]])
        on_border = np.tile(border, 2)
        length = np.linalg.norm(self.points[directed[:, 0]] - self.points[directed[:, 1]], axis=1)
        at_border = np.zeros(len(self.points), dtype=bool)
        at_border[edges[border]] = True
        allowed = ~self.fixed[directed[:, 0]] & (on_border | ~at_border[directed[:, 0]])
        allowed &= length < SHORTEST * size[directed].min(axis=1)
        directed, length = directed[allowed], length[allowed]
        if not len(directed):
            return
        cost = length * random.uniform(1, 2, len(length))
        order = np.lexsort((cost, directed[:, 0]))
        directed, cost = directed[order], cost[order]
        first = np.diff(directed[:, 0], prepend=-1) > 0
        directed, cost = directed[first], cost[first]
        good = self._may_collapse(directed, edges, size)
        directed, cost = directed[good], cost[good]
        if not len(directed):
            return
        rank = np.full(len(self.points), np.iinfo(np.int64).max)
        rank[directed[np.argsort(cost, kind="stable"), 0]] = np.arange(len(directed))
        around = _least_around(_least_around(rank, edges), edges)
        directed = directed[rank[directed[:, 0]] == around[directed[:, 0]]]
        target = np.arange(len(self.points))
        target[directed[:, 0]] = directed[:, 1]
        triangles = target[self.triangles]
        kept = np.all(triangles != np.roll(triangles, 1, axis=1), axis=1)
        self.triangles, self.patch = triangles[kept], self.patch[kept]

    def _may_collapse(self, directed: np.ndarray, edges: np.ndarray, size: np.ndarray) -> np.ndarray:
        """Mask (D,): whether the first vertex of each of D pairs ``directed`` may be merged into the second, its
        neighbour."""
        count = len(self.points)
        number = np.full(count, -1)
        number[directed[:, 0]] = np.arange(len(directed))
        # Topology: exactly two vertices are neighbours of both.
        ends = np.concatenate([edges, edges[:, ::-1]])
        key = np.sort(_keys(ends, count))
        ring = ends[number[ends[:, 0]] >= 0]
        candidate = number[ring[:, 0]]
        ring_keys = _keys(np.stack([directed[candidate, 1], ring[:, 1]], axis=1), count)
        is_neighbour = key[np.minimum(np.searchsorted(key, ring_keys), len(key) - 1)] == ring_keys
        good = np.bincount(candidate[is_neighbour], minlength=len(directed)) == 2

        row, k = np.nonzero(number[self.triangles] >= 0)
        candidate = number[self.triangles[row, k]]
        remaining = ~np.any(self.triangles[row] == directed[candidate, 1][:, None], axis=1)
        row, k, candidate = row[remaining], k[remaining], candidate[remaining]
        new = self.triangles[row].copy()
        new[np.arange(len(new)), k] = directed[candidate, 1]
        corners = self.points[new]
        normal = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        at_corner = self._corner_normals(new, self.patch[row])
        bad = np.einsum("tki,ti->tk", at_corner, normal).min(axis=1) < MOST_TURN
        before = _quality(self.points[self.triangles])
        bad |= _quality(corners) < np.minimum(GOOD, before[row])
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        longest = LONGEST * np.minimum(size[new], np.roll(size[new], 1, axis=1))
        old = self.points[self.triangles[row]]
        old_longest = np.linalg.norm(old - np.roll(old, 1, axis=1), axis=2).max(axis=1)
        bad |= np.any(sides > np.maximum(longest, old_longest[:, None]), axis=1)
        return good & (np.bincount(candidate[bad], minlength=len(directed)) == 0)

    def _corner_normals(self, triangles: np.ndarray, patch: np.ndarray) -> np.ndarray:
        """Mean normal (T, 3, 3) of a patch at the corners of triangles."""
        vectors = area_normals(self.points, self.triangles)
        keys = (self.triangles * self.patches.count + self.patch[:, None]).ravel()
        unique, number = np.unique(keys, return_inverse=True)
        total = np.zeros((len(unique), 3))
        np.add.at(total, number.reshape(-1), np.repeat(vectors, 3, axis=0))
        total = unit(total)
        corner_keys = triangles * self.patches.count + patch[:, None]
        at = np.minimum(np.searchsorted(unique, corner_keys), len(unique) - 1)
        return np.where((unique[at] == corner_keys)[..., None], total[at], 0.0)

    # -- Edges across the shorter diagonal ----------------------------------------------------------------------------
    def flip(self) -> None:
        for _ in range(FLIPS):
            if not self._flip_once():
                return

    def _flip_once(self) -> bool:
        edges, pairs, border = self._edges()
        edge_keys = _keys(edges, len(self.points))
        edges, pairs = edges[~border], pairs[~border]
        first, second = self.triangles[pairs[:, 0]], self.triangles[pairs[:, 1]]
        a, b = edges.T
        c = first.sum(axis=1) - a - b
        d = second.sum(axis=1) - a - b
        # The first triangle runs from a to b, or is turned to.
        k = np.argmax(first == a[:, None], axis=1)
        forward = first[np.arange(len(first)), (k + 1) % 3] == b
        a, b = np.where(forward, a, b), np.where(forward, b, a)
        new = np.stack([np.stack([c, a, d], axis=1), np.stack([d, b, c], axis=1)], axis=1)
        old = np.stack([first, second], axis=1)
        new_quality, old_quality = _quality(self.points[new]).min(axis=1), _quality(self.points[old]).min(axis=1)
        good = new_quality > old_quality + 0.02
        diagonals = np.sort(np.stack([c, d], axis=1), axis=1)
        good &= ~np.isin(_keys(diagonals, len(self.points)), edge_keys)
        if not good.any():
            return False
        rows = np.flatnonzero(good)
        patch = self.patch[pairs[rows, 0]]
        for side in (0, 1):
            normal = unit(area_normals(self.points, new[rows, side]))
            cosine = np.einsum("tki,ti->tk", self._corner_normals(new[rows, side], patch), normal).min(axis=1)
            rows, patch = rows[cosine > MOST_TURN], patch[cosine > MOST_TURN]
        gain = new_quality[rows] - old_quality[rows]
        rank = np.empty(len(rows), dtype=np.int64)
        rank[np.argsort(-gain, kind="stable")] = np.arange(len(rows))
        least = np.full(len(self.points), len(rows))
        corners = np.stack([a[rows], b[rows], c[rows], d[rows]], axis=1)
        np.minimum.at(least, corners.ravel(), np.repeat(rank, 4))
        rows = rows[np.all(least[corners] == rank[:, None], axis=1)]
        self.triangles = self.triangles.copy()
        self.triangles[pairs[rows, 0]], self.triangles[pairs[rows, 1]] = new[rows, 0], new[rows, 1]
        return len(rows) > 0

    # -- Vertices along the surface -----------------------------------------------------------------------------------
    def smooth(self) -> None:
        edges, _, border = self._edges()
        at_border = np.zeros(len(self.points), dtype=bool)
        at_border[edges[border]] = True
        ends = np.concatenate([edges, edges[:, ::-1]])
        counts = np.tile(border, 2) | ~at_border[ends[:, 0]]
        ends = ends[counts]
        total = np.zeros_like(self.points)
        np.add.at(total, ends[:, 0], self.points[ends[:, 1]])
        number = np.bincount(ends[:, 0], minlength=len(self.points))
        nodes = np.flatnonzero((number > 0) & ~self.fixed)
        if not len(nodes):  # large elements have corners of the body only
            return
        centroid = total[nodes] / number[nodes, None]
        before = self.points[nodes].copy()
        positions = 0.5 * (before + centroid)
        belongs, size = self.belongs[nodes], self.size[nodes]
        reach = REACH * float(size.max())
        positions = self.patches.onto_surface(positions, belongs, reach)
        self._move(nodes, self.patches.onto_features(positions, belongs, reach))


def _least_around(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Smallest value (V,) among each vertex and its neighbours, from values (V,) at the vertices."""
    result = values.copy()
    np.minimum.at(result, edges[:, 0], values[edges[:, 1]])
    np.minimum.at(result, edges[:, 1], values[edges[:, 0]])
    return result


def _quality(corners: np.ndarray) -> np.ndarray:
    """Shape quality (...,) of triangles (..., 3, 3): their area relative to their sides, 1 if equilateral."""
    a, b, c = (corners[..., k, :] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=-1)
    squares = ((b - a) ** 2 + (c - b) ** 2 + (a - c) ** 2).sum(axis=-1)
    return 2 * math.sqrt(3) * area / np.where(squares > 0, squares, 1.0)


def _keys(edges: np.ndarray, count: int) -> np.ndarray:
    """Unique integer key (E,) of each of ``edges`` (E, 2) between ``count`` vertices; keys sort like the edges."""
    return edges[:, 0].astype(np.int64) * count + edges[:, 1]
