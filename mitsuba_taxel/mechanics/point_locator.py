"""Search for the elements of an undeformed pad that contain given points, or are nearest to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.base.arguments import floats_of, shape_words
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.point_tree import PointTree
from mitsuba_taxel.geometry.quadratic_shapes import (
    control_points,
    hull_boxes,
    shape_functions,
    shape_gradients,
    tet_coordinates,
)
from mitsuba_taxel.geometry.surfaces.box_tree import BoxTree
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, VolumeMesh

SLACK = 1e-9
"""Tolerance of negative barycentric coordinates inside an element, so that rounding causes no gap between
neighbours."""
ROOM = 1e-6
"""Tolerance, above rounding, by which the barycentric coordinates of a point in a curved element may lie outside the
range of those of its hull."""
ROUNDING = 1e-14
"""Tolerance of Newton's method, relative to the largest coordinate."""
MOST_ITERATIONS = 30
POINTS_AT_ONCE = 16384
_SIDES = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])


@dataclass(frozen=True, eq=False)
class Location:
    """P points in an undeformed pad, with the elements that contain them, in a mesh of N nodes.

    Attributes
    ----------
    mesh : VolumeMesh
        The undeformed mesh.
    element : (P,) ndarray
        Number of the element of each point.
    reference : (P, 3) ndarray
        Reference coordinates in the element; for points outside, those of the nearest point of the silicone.
    offset : (P, 3) ndarray
        Vector in mm from the nearest point of the silicone; 0 inside.
    """

    mesh: VolumeMesh
    element: np.ndarray
    reference: np.ndarray
    offset: np.ndarray

    def interpolate(self, values: np.ndarray) -> np.ndarray:
        """Field (P, ...) at the points, from its ``values`` (N, ...) at the nodes.

        Outside, the field is extrapolated linearly from the nearest point of the silicone: exact for a linear field,
        with an error of the second derivative times half the square of the distance for others.
        """
        shape = (len(self.element), *values.shape[1:])
        return (self.weights @ values.reshape(len(values), -1)).reshape(shape)

    def gradient(self, values: np.ndarray) -> np.ndarray:
        """Derivatives [1/mm] (P, ..., 3) of a field with respect to the undeformed position, from its ``values`` (N,
        ...) at the nodes.

        Points outside have the derivatives at the nearest point of the silicone.
        """
        return np.einsum("pa...,paj->p...j", values[self.mesh.tets[self.element]], self._slopes)

    @cached_property
    def weights(self) -> sparse.csr_array:
        """Weights (P, N) with which nodal values give the values at the points, as in :meth:`interpolate`."""
        functions = shape_functions(tet_coordinates(self.reference))
        if self.offset.any():
            functions += np.einsum("paj,pj->pa", self._slopes, self.offset)
        return self._over_nodes(functions)

    def slope_weights(self, directions: np.ndarray) -> sparse.csr_array:
        """Weights (P, N) of nodal values for derivatives at the points along ``directions`` (P, 3); see `gradient`."""
        return self._over_nodes(np.einsum("paj,pj->pa", self._slopes, directions))

    def _over_nodes(self, of_element: np.ndarray) -> sparse.csr_array:
        """Weights (P, N) of all N nodes, from the weights (P, 10) of the ten nodes of each point's element."""
        nodes = self.mesh.tets[self.element]
        ends = np.arange(0, nodes.size + 1, nodes.shape[1])
        return sparse.csr_array((of_element.ravel(), nodes.ravel(), ends), shape=(len(nodes), len(self.mesh.points)))

    @cached_property
    def _slopes(self) -> np.ndarray:
        """Derivatives (P, 10, 3) of the shape functions with respect to the undeformed position, in 1/mm."""
        by_reference = shape_gradients(self.reference)
        jacobian = np.einsum("pai,paj->pji", by_reference, self.mesh.points[self.mesh.tets[self.element]])
        return by_reference @ np.linalg.inv(jacobian)


class PointLocator:
    """Finds the curved tetrahedra of a mesh that contain given points."""

    def __init__(self, mesh: VolumeMesh) -> None:
        self.mesh = mesh
        self._size = float(np.abs(mesh.points).max())
        self._boxes = _Boxes(mesh.points, mesh.tets)

    @cached_property
    def _boundary(self) -> _Boundary:
        return _Boundary(self.mesh)

    def locate(self, points: Sequence[Sequence[float]] | np.ndarray, tolerance: float = 0.0) -> Location:
        """Find the elements that contain points, and the reference coordinates of the points in them.

        Parameters
        ----------
        points : (P, 3) array_like
            Undeformed positions in mm.
        tolerance : float
            Allowed distance of points from the silicone in mm, such as on a rounder roof of a finer mesh.

        Returns
        -------
        Location
            Positions of all points.

        Raises
        ------
        InputError
            if points are not (P, 3) finite numbers, the tolerance is negative, or a point is farther from the silicone.
        """
        if not (math.isfinite(tolerance) and tolerance >= 0):
            raise InputError(f"tolerance = {tolerance} is not allowed: a finite distance of 0 mm or more is needed.")
        x = _checked(points)
        element, reference, offset = np.empty(len(x), dtype=np.int64), np.empty(x.shape), np.zeros(x.shape)
        for start in range(0, len(x), POINTS_AT_ONCE):
            chosen = slice(start, start + POINTS_AT_ONCE)
            element[chosen], reference[chosen] = self._find(x[chosen])
            outside = start + np.flatnonzero(element[chosen] < 0)
            element[outside], reference[outside], offset[outside] = self._beside(x[outside], tolerance)
        return Location(self.mesh, element, reference, offset)

    def _find(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find the element that contains each point (P, 3): its number, -1 outside the silicone, and the reference
        coordinates of the point in it.

        Of the elements whose boxes contain a point, the most likely one is tested first.
        """
        element, reference = np.full(len(x), -1), np.zeros(x.shape)
        row, candidate, start = self._likely(x, *self._boxes.overlapping(x, x))
        order = np.lexsort((_violation(start), row))
        row, candidate, start = row[order], candidate[order], start[order]
        rank = np.arange(len(row)) - np.searchsorted(row, row)
        for selected in (rank == 0, rank > 0):  # most points are in the most likely element
            candidates_now = np.flatnonzero(selected & (element[row] < 0))
            xi = self._inverted(x[row[candidates_now]], candidate[candidates_now], start[candidates_now])
            candidates_now, xi = (
                array[_violation(xi) <= SLACK][::-1] for array in (candidates_now, xi)
            )  # of several elements, the first is set last
            element[row[candidates_now]], reference[row[candidates_now]] = candidate[candidates_now], xi
        return element, reference

    def _likely(
        self, x: np.ndarray, row: np.ndarray, candidate: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs of a point and an element that may contain it: the two indices (K,) of K pairs, and the reference
        coordinates (K, 3) of the point in the straight tetrahedron between the element's corners.

        A pair is kept if these coordinates are within the range of the coordinates of the curved element's hull.
        """
        used, number = np.unique(candidate, return_inverse=True)
        nodes = self.mesh.points[self.mesh.tets[used]]
        first, sides = nodes[:, :1], nodes[:, 1:4] - nodes[:, :1]
        to_straight = np.linalg.inv(np.swapaxes(sides, 1, 2))
        hull = tet_coordinates((control_points(nodes) - first) @ np.swapaxes(to_straight, 1, 2))
        least, most = hull.min(axis=1) - ROOM, hull.max(axis=1) + ROOM
        start = np.einsum("kij,kj->ki", to_straight[number], x[row] - first[number, 0])
        coordinates = tet_coordinates(start)
        within = np.all((coordinates >= least[number]) & (coordinates <= most[number]), axis=1)
        return row[within], candidate[within], start[within]

    def _inverted(self, x: np.ndarray, element: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Reference coordinates (K, 3) of points (K, 3) by Newton's method, infinite where it fails.

        A step changes no barycentric coordinate by more than 1, to stay where the map is one to one.
        """
        xi, remaining = start.copy(), np.arange(len(x))
        for _ in range(MOST_ITERATIONS):
            nodes, current = self.mesh.points[self.mesh.tets[element[remaining]]], xi[remaining]
            residual = x[remaining] - np.einsum("ka,kai->ki", shape_functions(tet_coordinates(current)), nodes)
            is_open = np.linalg.norm(residual, axis=1) > ROUNDING * self._size
            remaining = remaining[is_open]
            if not len(remaining):
                return xi
            jacobian = np.einsum("kai,kaj->kji", shape_gradients(current[is_open]), nodes[is_open])
            step = _solved(jacobian, residual[is_open])
            xi[remaining] += step / np.maximum(1, np.abs(step).max(axis=1, keepdims=True))
        xi[remaining] = np.inf
        return xi

    def _beside(self, x: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nearest point of the silicone for points (P, 3) outside it: its element, its reference coordinates, and the
        vector from it to the point."""
        if not len(x):
            return np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, 3))
        is_beyond = self._boundary.are_beyond(x, tolerance)
        x = x[: int(np.argmax(is_beyond)) + 1] if is_beyond.any() else x  # the first is enough to raise
        element, reference = self._boundary.nearest(x)
        nodes = self.mesh.points[self.mesh.tets[element]]
        offset = x - np.einsum("ka,kai->ki", shape_functions(tet_coordinates(reference)), nodes)
        distance = np.linalg.norm(offset, axis=1)
        wrong = np.flatnonzero(distance > tolerance)
        if not len(wrong):
            return element, reference, offset
        shown = ", ".join(f"{value:.6g}" for value in x[wrong[0]])
        raise InputError(
            f"point ({shown}) lies outside the silicone, {distance[wrong[0]]:.3g} mm from it: "
            f"a point of the undeformed pad, or within tolerance = {tolerance:g} mm of it, is needed."
        )


class _Boxes:
    """Bounding boxes of n curved elements or faces with nodes (n, 10) or (n, 6), a little larger than their hulls."""

    def __init__(self, points: np.ndarray, nodes: np.ndarray) -> None:
        slack = SLACK * float(np.abs(points).max())
        low, high = hull_boxes(points, nodes)
        self.low, self.high = low - slack, high + slack
        self._tree = BoxTree(self.low + self.high)
        self._levels = self._tree.levels(self.low, self.high)

    def overlapping(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the K pairs of boxes that overlap: (K,) of the P boxes with the corners ``low`` and ``high`` (P,
        3), and (K,) of the boxes of this object."""
        tree = BoxTree(low + high)
        return tree.overlapping_with(tree.levels(low, high), self._tree, self._levels)


class _Boundary:
    """The curved faces of a mesh's surface, for the search for nearest points."""

    def __init__(self, mesh: VolumeMesh) -> None:
        self._nodes = mesh.points[mesh.faces]
        self._boxes = _Boxes(mesh.points, mesh.faces)
        self._largest = float(np.linalg.norm(self._boxes.high - self._boxes.low, axis=1).max())
        self._tree = PointTree(mesh.points[np.unique(mesh.faces)])
        self._owner = _owners(mesh)
        self._corner = (mesh.tets[self._owner, None, :4] == mesh.faces[:, :3, None]).argmax(axis=2)

    def are_beyond(self, x: np.ndarray, distance: float) -> np.ndarray:
        """Mask (P,): whether points are certainly farther from the pad's surface than a distance in mm, judged by their
        nearest node.
        """
        return self._tree.query(x)[0] > distance + self._largest

    def nearest(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Element and reference coordinates of the surface point that is nearest to each of P points (P, 3)."""
        bound = self._tree.query(x)[0]
        row, face = self._boxes.overlapping(x - bound[:, None], x + bound[:, None])
        excess = np.maximum(self._boxes.low[face] - x[row], x[row] - self._boxes.high[face])
        is_near = np.linalg.norm(np.maximum(excess, 0), axis=1) <= bound[row]
        row, face = row[is_near], face[is_near]
        foot, distance = self._feet(x[row], face)
        order = np.lexsort((distance, row))
        best = order[np.unique(row[order], return_index=True)[1]]
        barycentric = np.zeros((len(x), 4))
        np.put_along_axis(barycentric, self._corner[face[best]], foot[best], axis=1)
        return self._owner[face[best]], barycentric[:, 1:]

    def _feet(self, x: np.ndarray, face: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of curved faces: for K pairs of a point and a face, the barycentric coordinates (K, 3) of the
        point of the face that is nearest, and the distance (K,).

        The Gauss-Newton method is used: the nearest point of the tangent triangle is computed repeatedly, as long as
        the distance decreases.
        """
        barycentric, remaining = np.full((len(x), 3), 1 / 3), np.arange(len(x))
        best, least = barycentric.copy(), np.full(len(x), np.inf)
        for _ in range(MOST_ITERATIONS):
            nodes = self._nodes[face[remaining]]
            surface_point = np.einsum("ka,kai->ki", shape_functions(barycentric), nodes)
            distance = np.linalg.norm(x[remaining] - surface_point, axis=1)
            better = distance < (1 - SLACK) * least[remaining]
            remaining, barycentric, nodes, surface_point = (
                remaining[better],
                barycentric[better],
                nodes[better],
                surface_point[better],
            )
            if not len(remaining):
                break
            best[remaining], least[remaining] = barycentric, distance[better]
            slope = np.einsum("kab,kai->kbi", _triangle_slopes(barycentric), nodes)
            corners = surface_point[:, None] + slope - np.einsum("kb,kbi->ki", barycentric, slope)[:, None]
            barycentric = _nearest_in_triangle(corners, x[remaining])
        return best, least


locator_of = kept(4)(PointLocator)  # the states of a path share their mesh


def _checked(points: Sequence[Sequence[float]] | np.ndarray) -> np.ndarray:
    """Convert points to an array (P, 3); raises `InputError` if that is not possible."""
    x = floats_of(points)
    if x.ndim != 2 or x.shape[1] != 3:
        raise InputError(f"points {shape_words(points)} are not allowed: rows of three numbers are needed.")
    wrong = np.flatnonzero(~np.all(np.isfinite(x), axis=1))
    if len(wrong):
        raise InputError(f"points[{wrong[0]}] = {x[wrong[0]].tolist()} is not allowed: finite numbers are needed.")
    return x


def _triangle_slopes(barycentric: np.ndarray) -> np.ndarray:
    """Derivatives (Q, 6, 3) of the six shape functions of a triangle with respect to its three barycentric coordinates,
    as if these were independent variables.
    """
    slopes = np.zeros((len(barycentric), 6, 3))
    slopes[:, range(3), range(3)] = 4 * barycentric - 1
    for node, (i, j) in enumerate(FACE_EDGES, start=3):
        slopes[:, node, i], slopes[:, node, j] = 4 * barycentric[:, j], 4 * barycentric[:, i]
    return slopes


def _violation(xi: np.ndarray) -> np.ndarray:
    """Measure (K,) of how far reference points (K, 3) are outside an element: the negative of the smallest barycentric
    coordinate; 0 inside."""
    return np.maximum(-xi.min(axis=1), xi.sum(axis=1) - 1)


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions (K, 3) of K linear systems by Cramer's rule. A singular matrix, as it occurs far outside an element,
    does not affect the other systems."""
    a, b, c = (matrix[:, :, k] for k in range(3))
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    determinant = np.einsum("ki,ki->k", a, cofactors[:, 0])
    determinant = np.where(determinant == 0, np.finfo(float).tiny, determinant)
    with np.errstate(over="ignore"):
        return np.clip(np.einsum("kij,kj->ki", cofactors, right) / determinant[:, None], -1e3, 1e3)


def _owners(mesh: VolumeMesh) -> np.ndarray:
    """Number (B,) of the element to which each of the B faces of the surface belongs."""
    sides = np.sort(mesh.tets[:, _SIDES].reshape(-1, 3), axis=1)
    count = mesh.corner_count
    keys, face_keys = (
        corners[:, 0] * count**2 + corners[:, 1] * count + corners[:, 2]
        for corners in (sides.astype(np.int64), np.sort(mesh.faces[:, :3], axis=1).astype(np.int64))
    )
    order = np.argsort(keys)
    return order[np.searchsorted(keys, face_keys, sorter=order)] // len(_SIDES)


def _nearest_in_triangle(corners: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (K, 3) of the point of each flat triangle (K, 3, 3) nearest to each point (K, 3)."""
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], x - corners[:, 0]
    normal = np.cross(u, v)
    scale = np.einsum("ki,ki->k", normal, normal)
    second = np.einsum("ki,ki->k", np.cross(w, v), normal) / scale
    third = np.einsum("ki,ki->k", np.cross(u, w), normal) / scale
    result = np.stack([1 - second - third, second, third], axis=1)
    outside = np.flatnonzero(result.min(axis=1) < 0)
    corners, x = corners[outside], x[outside]
    least = np.full(len(outside), np.inf)
    for i, j in FACE_EDGES:
        edge = corners[:, j] - corners[:, i]
        from_corner = x - corners[:, i]
        t = np.clip(np.einsum("ki,ki->k", from_corner, edge) / np.einsum("ki,ki->k", edge, edge), 0, 1)
        distance = np.linalg.norm(corners[:, i] + t[:, None] * edge - x, axis=1)
        nearer = distance < least
        least[nearer] = distance[nearer]
        result[np.ix_(outside[nearer], [0, 1, 2])] = 0
        result[outside[nearer], i], result[outside[nearer], j] = 1 - t[nearer], t[nearer]
    return result
