"""Signed distance from a closed surface of triangles, as a cubic spline over a grid: smooth enough for Newton's method.

A spline through exact distances follows a finely tessellated surface to a fraction of what its triangles are off, and
rounds edges by about the grid's spacing.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mitsuba_taxel.geometry.point_tree import PointTree
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, closest_on_triangles, unit

CELLS = 48
"""Of the grid along its longest side."""
MARGIN, RIM = 6, 3
"""Cells beyond the surface, and those of them at the rim, where the spline is off."""
NEAR = 3.0
"""Distance in cells up to which it is exact; further away, where nothing presses, it is about that."""
CANDIDATES = 8
"""Samples near a place, of whose triangles the nearest is taken."""
APART = 0.5
"""Size in cells of what has one sample for the distances that are far: thin triangles have very many."""
ALIKE = 1e-9
"""Difference in distance, in cells, of triangles that share the nearest point."""
PLACES_AT_ONCE = 20_000

_CUBIC = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6
"""Coefficients of 1, t, t², t³ of the four cubic B-splines that are not 0 between two nodes."""
_DERIVATIVES = [
    *((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    *((2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 0), (0, 1, 1), (1, 0, 1)),
]
"""How often by x, y and z."""


class SolidDistance:
    """Distances from a closed surface, negative inside.

    Of a surface that is higher than wide, only the lower part is known, as high as wide.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        In mm; the lowest at z = 0.
    triangles : (T, 3) ndarray
        Counter-clockwise seen from outside.
    """

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray) -> None:
        self._corners = vertices[triangles]
        self._outwards = unit(area_normals(vertices, triangles))
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        high[2] = min(high[2], (high - low)[:2].max())
        self.spacing = float((high - low).max()) / CELLS
        self._first = low - MARGIN * self.spacing
        self._counts = np.ceil((high - self._first) / self.spacing).astype(int) + 1 + MARGIN

    def at(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distances (n,) in mm of places (n, 3), with their first (n, 3) and second (n, 3, 3) derivatives."""
        low, high = (self._first + self.spacing * (end + RIM * sign) for end, sign in ((0, 1), (self._counts - 1, -1)))
        within = np.clip(places, low, high)
        size, slope, bend = self._spline(within)
        beyond = places - within
        further = np.linalg.norm(beyond, axis=1)
        slope = np.where(beyond == 0, slope, 0.0) + unit(beyond)
        return size + further, slope, np.where(further[:, None, None] > 0, 0.0, bend)

    def footprint(self, height: float) -> np.ndarray:
        """(n, 2) nodes of the grid in x and y at which the body is at a height in mm above its lowest point."""
        x, y = (self._first[k] + self.spacing * np.arange(self._counts[k]) for k in (0, 1))
        places = np.stack(np.meshgrid(x, y, [height], indexing="ij"), axis=-1).reshape(-1, 3)
        return places[self.at(places)[0] <= 0, :2]

    def _spline(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        along = (places - self._first) / self.spacing
        cell = np.floor(along).astype(int)
        t = along - cell
        powers = np.stack([np.ones_like(t), t, t**2, t**3], axis=-1)
        slopes = np.stack([np.zeros_like(t), np.ones_like(t), 2 * t, 3 * t**2], axis=-1) / self.spacing
        bends = np.stack([np.zeros_like(t), np.zeros_like(t), np.full_like(t, 2.0), 6 * t], axis=-1) / self.spacing**2
        weights = [terms @ _CUBIC.T for terms in (powers, slopes, bends)]  # (n, 3 axes, 4) each
        x, y, z = (cell[:, k, None] + np.arange(-1, 3) for k in range(3))
        around = self._coefficients[x[:, :, None, None], y[:, None, :, None], z[:, None, None, :]]
        along_z = [np.einsum("nijk,nk->nij", around, weights[order][:, 2]) for order in range(3)]
        along_yz = {
            (j, k): np.einsum("nij,nj->ni", along_z[k], weights[j][:, 1]) for j in range(3) for k in range(3 - j)
        }
        size, dx, dy, dz, xx, yy, zz, xy, yz, xz = (
            np.einsum("ni,ni->n", along_yz[j, k], weights[i][:, 0]) for i, j, k in _DERIVATIVES
        )
        bend = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)
        return size, np.stack([dx, dy, dz], axis=1), bend

    @cached_property
    def _coefficients(self) -> np.ndarray:
        from scipy import ndimage  # here, as only bodies from files need it

        axes = [self._first[k] + self.spacing * np.arange(self._counts[k]) for k in range(3)]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        size, inside = self._of_places(nodes)
        part, count = ndimage.label((size > self.spacing).reshape(self._counts))
        # What is far from the surface may be nearest to an edge: all that hangs together is on one side.
        mostly = np.append(False, ndimage.mean(inside.reshape(self._counts), part, np.arange(1, count + 1)) > 0.5)
        inside = np.where(part.ravel() > 0, mostly[part.ravel()], inside)
        distance = np.where(inside, -size, size).reshape(self._counts)
        return ndimage.spline_filter(distance, order=3, mode="mirror")

    def _of_places(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances without a sign, and whether places (n, 3) are inside as the nearest triangle has it."""
        samples, owner = _samples(self._corners, self.spacing, self._first[2] + self._counts[2] * self.spacing)
        few = _one_of_each(np.floor((samples - self._first) / (APART * self.spacing)).astype(int))
        tree, coarse_tree = PointTree(samples), PointTree(samples[few])
        size, inside = np.empty(len(places)), np.empty(len(places), dtype=bool)
        for start in range(0, len(places), PLACES_AT_ONCE):
            some = places[start : start + PLACES_AT_ONCE]
            near = np.isfinite(tree.query(some, within=NEAR * self.spacing)[0])
            for which, candidates in (
                (~near, owner[few[coarse_tree.query(some[~near])[1]], None]),
                (near, owner[tree.query(some[near], k=np.arange(1, 1 + min(CANDIDATES, len(samples))))[1]]),
            ):
                numbers = start + np.flatnonzero(which)
                size[numbers], inside[numbers] = self._nearest(some[which], candidates)
        return size, inside

    def _nearest(self, places: np.ndarray, candidates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of candidates (n, k): distances (n,), and whether the places are behind the triangle that they face most."""
        shape = candidates.shape
        spread = np.repeat(places, shape[1], axis=0)
        way = spread - closest_on_triangles(spread, self._corners[candidates.ravel()])
        distance = np.linalg.norm(way, axis=1).reshape(shape)
        facing = np.einsum("ij,ij->i", unit(way), self._outwards[candidates.ravel()]).reshape(shape)
        nearest = distance.min(axis=1)
        among = distance <= nearest[:, None] + ALIKE * self.spacing
        chosen = np.argmax(np.where(among, np.abs(facing), -1.0), axis=1)
        return nearest, np.take_along_axis(facing, chosen[:, None], axis=1)[:, 0] < 0


def _one_of_each(cells: np.ndarray) -> np.ndarray:
    """Of points with the cells (n, 3) that they are in, the number of one in each cell."""
    return np.unique(cells, axis=0, return_index=True)[1]


def _samples(corners: np.ndarray, spacing: float, top: float) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 3) of pieces of triangles (T, 3, 3) of at most twice the spacing in size, and whose they are (n,)."""
    owner, found = np.flatnonzero(corners[:, :, 2].min(axis=1) < top), []
    pieces = corners[owner]
    while len(pieces):
        sides = np.linalg.norm(np.roll(pieces, -1, axis=1) - pieces, axis=2)
        small = sides.max(axis=1) <= 2 * spacing
        found.append((pieces[small].mean(axis=1), owner[small]))
        large = ~small & (pieces[:, :, 2].min(axis=1) < top)
        first = (sides[large].argmax(axis=1)[:, None] + np.arange(3)) % 3
        turned, whose = np.take_along_axis(pieces[large], first[:, :, None], axis=1), owner[large]
        middle = turned[:, :2].mean(axis=1)
        halves = [
            np.stack([turned[:, 0], middle, turned[:, 2]], axis=1),
            np.stack([middle, turned[:, 1], turned[:, 2]], axis=1),
        ]
        pieces, owner = np.concatenate(halves), np.concatenate([whose, whose])
    samples, owners = zip(*found, strict=True)
    return np.concatenate(samples), np.concatenate(owners)
