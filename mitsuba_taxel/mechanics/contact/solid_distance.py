"""Signed distance from a closed surface of triangles, as a cubic spline over a grid: smooth enough for Newton's method.

The spline interpolates exact distances at the nodes of the grid. From a finely tessellated surface it deviates by a
fraction of the error of the triangles, and it rounds edges by about the spacing of the grid.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from mitsuba_taxel.geometry.point_tree import PointTree
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, closest_on_triangles, unit

CELLS = 48
"""Cells of the grid along its longest side."""
MARGIN, RIM = 6, 3
"""Number of cells of the grid beyond the surface; number of the outermost cells that are not used, because the spline
is inaccurate there."""
NEAR = 3.0
"""Distance in cells up to which the signed distance is exact; farther away, where there is no contact, it is
approximate."""
CANDIDATES = 8
"""Number of samples near a point whose triangles are searched for the nearest triangle."""
SAMPLE_SPACING = 0.5
"""Size, in cells of the grid, of boxes of which each keeps one sample for large distances: thin triangles have very
many samples."""
ALIKE = 1e-9
"""Difference in distance, in cells, of triangles that share the nearest point."""
STEEP = 60.0
"""Angle in degrees, from the horizontal, above which a surface is a steep wall."""
ROUNDED = 1.5
"""Height in cells of the grid below which walls are rounded by the spline."""
SYMMETRIC = 1e-9
"""Largest difference, in cells of the grid, of distances from a symmetric surface and from its mirror image."""
POINTS_AT_ONCE = 20_000

_CUBIC = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6
"""Coefficients of 1, t, t², t³ of the four cubic B-splines that are not 0 between two nodes."""
_DERIVATIVES = [
    *((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    *((2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 0), (0, 1, 1), (1, 0, 1)),
]
"""Orders of the derivatives of the spline with respect to x, y and z."""


class SolidDistance:
    """Distances from a closed surface, negative inside.

    If the surface is higher than wide, only its lower part is used, up to a height equal to its width.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm; the lowest vertex is at z = 0.
    triangles : (T, 3) ndarray
        Vertices of each triangle, counter-clockwise seen from outside.
    """

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray) -> None:
        self._corners = vertices[triangles]
        self._outwards = unit(area_normals(vertices, triangles))
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        high[2] = min(high[2], (high - low)[:2].max())
        self.spacing = float((high - low).max()) / CELLS
        self._first = low - MARGIN * self.spacing
        self._counts = np.ceil((high - self._first) / self.spacing - ALIKE).astype(int) + 1 + MARGIN
        # The grid is centred on the box of the surface, so that it shares the mirrors of the body.
        self._first[:2] = (0.5 * (low + high - (self._counts - 1) * self.spacing))[:2]
        self._mirrors: dict[bytes, bool] = {}

    def at(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distances (n,) in mm of points (n, 3), with their first (n, 3) and second (n, 3, 3) derivatives."""
        low, high = (self._first + self.spacing * (end + RIM * sign) for end, sign in ((0, 1), (self._counts - 1, -1)))
        clamped = np.clip(points, low, high)
        size, slope, curvature = self._spline(clamped)
        beyond = points - clamped
        distance_beyond = np.linalg.norm(beyond, axis=1)
        slope = np.where(beyond == 0, slope, 0.0) + unit(beyond)
        return size + distance_beyond, slope, np.where(distance_beyond[:, None, None] > 0, 0.0, curvature)

    def walls(self, height: float) -> np.ndarray:
        """Positions (n, 2) in mm, along x and y, of those nodes of the footprint at a height in mm that lie at its edge
        where the surface is steeper than `STEEP`. Below `ROUNDED` cells the spline rounds edges: they are searched
        there."""
        height = max(height, ROUNDED * self.spacing)
        x, y = (self._first[k] + self.spacing * np.arange(self._counts[k]) for k in (0, 1))
        points = np.stack(np.meshgrid(x, y, [height], indexing="ij"), axis=-1).reshape(-1, 3)
        size, slope, _ = self.at(points)
        inside = np.pad((size <= 0).reshape(len(x), len(y)), 1)
        surrounded = inside[:-2, 1:-1] & inside[2:, 1:-1] & inside[1:-1, :-2] & inside[1:-1, 2:]
        at_edge = (inside[1:-1, 1:-1] & ~surrounded).ravel()
        return points[at_edge & (np.abs(slope[:, 2]) < math.cos(math.radians(STEEP))), :2]

    def keeps(self, mirror: np.ndarray) -> bool:
        """Whether the distances are symmetric in a mirror, given as a matrix (3, 3): at every second node of the
        grid near the surface, they are those at the mirror image of the node, to `SYMMETRIC` cells."""
        key = np.round(mirror, 12).tobytes()
        if key not in self._mirrors:
            axes = [self._first[k] + self.spacing * np.arange(self._counts[k]) for k in range(3)]
            inner = [axis[RIM:-RIM:2] for axis in axes]
            nodes = np.stack(np.meshgrid(*inner, indexing="ij"), axis=-1).reshape(-1, 3)
            distance = self.at(nodes)[0]
            near = np.abs(distance) < 2 * self.spacing
            image = self.at(nodes[near] @ mirror.T)[0]
            self._mirrors[key] = bool(np.abs(image - distance[near]).max() <= SYMMETRIC * self.spacing)
        return self._mirrors[key]

    def footprint(self, height: float) -> np.ndarray:
        """Positions (n, 2) in mm, along x and y, of nodes that are inside the body at a height in mm above its lowest
        point. They are nodes of the grid on which distances to the body are interpolated."""
        x, y = (self._first[k] + self.spacing * np.arange(self._counts[k]) for k in (0, 1))
        points = np.stack(np.meshgrid(x, y, [height], indexing="ij"), axis=-1).reshape(-1, 3)
        return points[self.at(points)[0] <= 0, :2]

    def _spline(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        scaled = (points - self._first) / self.spacing
        cell = np.floor(scaled).astype(int)
        t = scaled - cell
        powers = np.stack([np.ones_like(t), t, t**2, t**3], axis=-1)
        slopes = np.stack([np.zeros_like(t), np.ones_like(t), 2 * t, 3 * t**2], axis=-1) / self.spacing
        curvatures = (
            np.stack([np.zeros_like(t), np.zeros_like(t), np.full_like(t, 2.0), 6 * t], axis=-1) / self.spacing**2
        )
        weights = [terms @ _CUBIC.T for terms in (powers, slopes, curvatures)]  # (n, 3 axes, 4) each
        x, y, z = (cell[:, k, None] + np.arange(-1, 3) for k in range(3))
        coefficients = self._coefficients[x[:, :, None, None], y[:, None, :, None], z[:, None, None, :]]
        along_z = [np.einsum("nijk,nk->nij", coefficients, weights[order][:, 2]) for order in range(3)]
        along_yz = {
            (j, k): np.einsum("nij,nj->ni", along_z[k], weights[j][:, 1]) for j in range(3) for k in range(3 - j)
        }
        size, dx, dy, dz, xx, yy, zz, xy, yz, xz = (
            np.einsum("ni,ni->n", along_yz[j, k], weights[i][:, 0]) for i, j, k in _DERIVATIVES
        )
        curvature = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)
        return size, np.stack([dx, dy, dz], axis=1), curvature

    @property
    def _top(self) -> float:
        """Height in mm below which the surface is used."""
        return float(self._first[2] + self._counts[2] * self.spacing)

    @cached_property
    def _coefficients(self) -> np.ndarray:
        from scipy import ndimage  # here, as only bodies from files need it

        axes = [self._first[k] + self.spacing * np.arange(self._counts[k]) for k in range(3)]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        size, inside = self._unsigned(nodes)
        component, count = ndimage.label((size > self.spacing).reshape(self._counts))
        # Far from the surface, the nearest triangle may be wrong at an edge: a connected region is on one side, and a
        # majority decides.
        mostly_inside = np.append(
            False, ndimage.mean(inside.reshape(self._counts), component, np.arange(1, count + 1)) > 0.5
        )
        inside = np.where(component.ravel() > 0, mostly_inside[component.ravel()], inside)
        distance = np.where(inside, -size, size).reshape(self._counts)
        return ndimage.spline_filter(distance, order=3, mode="mirror")

    def _unsigned(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (n,) of points (n, 3) without a sign, and whether they are inside according to the nearest
        triangle."""
        samples, owner = _samples(self._corners, self.spacing, self._top)
        boxes = np.floor((samples - self._first) / (SAMPLE_SPACING * self.spacing)).astype(int)
        sparse_samples = np.unique(boxes, axis=0, return_index=True)[1]
        tree, coarse_tree = PointTree(samples), PointTree(samples[sparse_samples])
        size, inside = np.empty(len(points)), np.empty(len(points), dtype=bool)
        for start in range(0, len(points), POINTS_AT_ONCE):
            batch = points[start : start + POINTS_AT_ONCE]
            is_near = np.isfinite(tree.query(batch, within=NEAR * self.spacing)[0])
            for selected, candidates in (
                (~is_near, owner[sparse_samples[coarse_tree.query(batch[~is_near])[1]], None]),
                (is_near, owner[tree.query(batch[is_near], k=np.arange(1, 1 + min(CANDIDATES, len(samples))))[1]]),
            ):
                rows = start + np.flatnonzero(selected)
                size[rows], inside[rows] = self._nearest(batch[selected], candidates)
        return size, inside

    def _nearest(self, points: np.ndarray, candidates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (n,) of points (n, 3) from the nearest of their candidate triangles (n, k), and whether they are
        behind it. If several triangles share the nearest point, the triangle that faces the point most directly is
        used."""
        shape = candidates.shape
        repeated = np.repeat(points, shape[1], axis=0)
        offset = repeated - closest_on_triangles(repeated, self._corners[candidates.ravel()])
        distance = np.linalg.norm(offset, axis=1).reshape(shape)
        facing = np.einsum("ij,ij->i", unit(offset), self._outwards[candidates.ravel()]).reshape(shape)
        nearest = distance.min(axis=1)
        shares_nearest = distance <= nearest[:, None] + ALIKE * self.spacing
        chosen = np.argmax(np.where(shares_nearest, np.abs(facing), -1.0), axis=1)
        return nearest, np.take_along_axis(facing, chosen[:, None], axis=1)[:, 0] < 0


def _samples(corners: np.ndarray, spacing: float, top: float) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 3) of pieces of triangles (T, 3, 3), of at most twice the spacing in size, and their triangles (n,).

    Longest edges are halved until pieces are small enough; pieces above ``top`` are left out.
    """
    triangle, batches = np.flatnonzero(corners[:, :, 2].min(axis=1) < top), []
    pieces = corners[triangle]
    while len(pieces):
        sides = np.linalg.norm(np.roll(pieces, -1, axis=1) - pieces, axis=2)
        small = sides.max(axis=1) <= 2 * spacing
        batches.append((pieces[small].mean(axis=1), triangle[small]))
        large = ~small & (pieces[:, :, 2].min(axis=1) < top)
        first = (sides[large].argmax(axis=1)[:, None] + np.arange(3)) % 3
        rotated, halved_triangle = np.take_along_axis(pieces[large], first[:, :, None], axis=1), triangle[large]
        middle = rotated[:, :2].mean(axis=1)
        halves = [
            np.stack([rotated[:, 0], middle, rotated[:, 2]], axis=1),
            np.stack([middle, rotated[:, 1], rotated[:, 2]], axis=1),
        ]
        pieces, triangle = np.concatenate(halves), np.concatenate([halved_triangle, halved_triangle])
    samples, triangles = zip(*batches, strict=True)
    return np.concatenate(samples), np.concatenate(triangles)
