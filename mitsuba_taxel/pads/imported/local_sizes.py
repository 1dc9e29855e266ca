"""Local element sizes of a pad from a file, by the rules of the built-in pads (see `meshing`)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.point_tree import PointTree
from mitsuba_taxel.geometry.surfaces.box_tree import TooManyPairs
from mitsuba_taxel.geometry.surfaces.triangles import closest_on_segments, closest_on_triangles, near, neighbours
from mitsuba_taxel.pads.block import ELEMENTS_ALONG
from mitsuba_taxel.pads.cells.cell_shape import ON_FLAT_WALLS, ON_ROUND_WALLS
from mitsuba_taxel.pads.imported.symmetric_part import PLANE
from mitsuba_taxel.pads.imported.triangles.curvature import radii
from mitsuba_taxel.pads.imported.triangles.snapping import Patches
from mitsuba_taxel.pads.parametric.meshing import BULK_COARSENING, CURVATURE_SAFETY, RIM_REFINEMENT
from mitsuba_taxel.pads.parametric.pad import DEFAULT_MESH_SIZE, MIN_THICKNESS, TYPICAL_CELL, TYPICAL_THICKNESS
from mitsuba_taxel.pads.regions import REGIONS

GRADING = 0.4
"""Growth of the element size per length, away from singular edges."""
MOST_POINTS = 1000
"""Most points of a cell at which the thickness of the silicone is measured."""


def default_mesh_size(vertices: np.ndarray, triangles: np.ndarray, region: np.ndarray, cell: np.ndarray) -> float:
    """Default size of elements, by the rule of `Pad.default_mesh_size`.

    It scales with the size of the smallest cell, and with the square root of the least thickness of the silicone beside
    or above a cell. A surface without cells has the default size of a block.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Vertices of the surface, mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    region, cell : (T,) ndarray of int
        Code of the region, and number of the cell.

    Returns
    -------
    float
        Mesh size in mm, to three digits.
    """
    if not cell.any():
        return float(f"{ELEMENTS_ALONG * np.ptp(vertices, axis=0).min():.3g}")
    cells = [vertices[np.unique(triangles[cell == number])] for number in np.unique(cell[cell > 0])]
    scale = min(float(np.ptp(points[:, :2], axis=0).min()) for points in cells) / TYPICAL_CELL
    thinnest = TYPICAL_THICKNESS * scale
    opposite = cell + np.where(np.isin(region, (REGIONS["top"], REGIONS["outer"])), -1, 0)
    for number, points in enumerate(cells, start=1):
        facing = vertices[triangles[(opposite != number) & (opposite != 0)]]
        points = points[np.unique(np.linspace(0, len(points) - 1, MOST_POINTS).astype(int))]
        try:
            point, triangle = near(points, facing, thinnest)
        except TooManyPairs:
            continue
        distance = np.linalg.norm(closest_on_triangles(points[point], facing[triangle]) - points[point], axis=1)
        thinnest = min(thinnest, float(distance.min(initial=np.inf)))
    thinnest = max(thinnest, MIN_THICKNESS * TYPICAL_CELL * scale)
    return float(f"{DEFAULT_MESH_SIZE * math.sqrt(scale * thinnest / TYPICAL_THICKNESS):.3g}")


class SingularEdges:
    """Edges of a pad at which the stress is singular: the glued rim, and sharp re-entrant edges of the silicone.

    Parameters
    ----------
    patches : Patches
        Patches of the surface.
    region : (T,) ndarray
        Code of the region of each triangle.
    patch : (T,) ndarray
        Number of the patch or face of each triangle; the edges lie between different numbers.

    Attributes
    ----------
    ends : (E, 2, 3) ndarray
        Ends of these edges, mm.
    between : (P, 2) ndarray
        Pairs of patches between which such edges lie.
    """

    def __init__(self, patches: Patches, region: np.ndarray, patch: np.ndarray) -> None:
        edges, pairs = neighbours(patches.triangles)
        first, second = pairs.T
        border = (patch[first] != patch[second]) & (region[first] != PLANE) & (region[second] != PLANE)
        edges, first, second = edges[border], first[border], second[border]
        glued = (region[first] == REGIONS["bottom"]) != (region[second] == REGIONS["bottom"])
        beyond = patches.vertices[patches.triangles[second]].mean(axis=1) - patches.vertices[edges[:, 0]]
        sharp = patches.sheet[first] != patches.sheet[second]
        singular = glued | (sharp & (np.einsum("ij,ij->i", patches.normals[first], beyond) > 0))
        self.ends = patches.vertices[edges[singular]]
        between = np.stack([patch[first[singular]], patch[second[singular]]], axis=1)
        self.between = np.unique(np.sort(between, axis=1), axis=0)

    def nodes(self, points: np.ndarray, faces: np.ndarray, patch: np.ndarray) -> np.ndarray:
        """Mask of the nodes of a mesh that lie on edges at which the stress is singular.

        Parameters
        ----------
        points : (N, 3) ndarray
            Nodes, mm.
        faces : (B, 6) ndarray
            Boundary triangles.
        patch : (B,) ndarray
            Number of the patch that each triangle follows.

        Returns
        -------
        (N,) ndarray of bool
            One value for each node.
        """
        on = np.zeros(len(points), dtype=bool)
        for first, second in self.between:
            on[np.intersect1d(faces[patch == first], faces[patch == second])] = True
        return on

    def nodes_on_planes(self, points: np.ndarray, planes: Sequence[Mirror], tolerance: float) -> np.ndarray:
        """Mask of the points that lie both on an edge with singular stress and in a plane of symmetry, where the mesh
        ends.

        Parameters
        ----------
        points : (N, 3) ndarray
            Positions in mm.
        planes : sequence of Mirror
            The planes of symmetry.
        tolerance : float
            Largest distance from an edge, mm.

        Returns
        -------
        (N,) ndarray of bool
            One value for each point.
        """
        on_plane = [np.all(np.abs(mirror.side(self.ends)) <= tolerance, axis=1) for mirror in planes]
        ends = self.ends[np.any(on_plane, axis=0)] if on_plane else self.ends[:0]
        on = np.zeros(len(points), dtype=bool)
        if len(ends):
            point, segment = near(points, ends, tolerance)
            offset = closest_on_segments(points[point], ends[segment, 0], ends[segment, 1]) - points[point]
            on[point[np.linalg.norm(offset, axis=1) <= tolerance]] = True
        return on


class LocalSizes:
    """Function of a point that returns the target length of mesh edges there in mm, for elements of about ``mesh_size``
    / ``refinement`` mm.
    """

    def __init__(
        self, patches: Patches, region: np.ndarray, singular: SingularEdges, mesh_size: float, refinement: float
    ) -> None:
        self._patch = patch_sizes(patches, region, mesh_size) / refinement
        self._edge = mesh_size / RIM_REFINEMENT / refinement
        self._tree = PointTree(_along(singular.ends, 0.5 * self._edge))

    def __call__(self, points: np.ndarray, belongs: np.ndarray) -> np.ndarray:
        """Target length (N,) of edges in mm at N points (N, 3); ``belongs`` (N, P) is the mask of the patches on which
        each lies."""
        distance, _ = self._tree.query(points)
        patch_size = np.where(belongs, self._patch, np.inf).min(axis=1)
        return np.minimum(patch_size, self._edge + GRADING * distance)


def patch_sizes(patches: Patches, region: np.ndarray, mesh_size: float) -> np.ndarray:
    """Length of edges on each patch: shorter on roofs and sides, and on patches of small radius.

    Parameters
    ----------
    patches : Patches
        Patches of the surface.
    region : (T,) ndarray
        Code of the region of each triangle.
    mesh_size : float
        Length of the edges of elements, mm.

    Returns
    -------
    (P,) ndarray
        Lengths in mm.
    """
    radius = radii(patches)
    first = np.unique(patches.patch, return_index=True)[1]
    size = np.full(patches.count, BULK_COARSENING * mesh_size)
    in_cell = np.isin(region[first], (REGIONS["roof"], REGIONS["side"]))
    flat = np.isinf(radius)
    size[in_cell & flat] = mesh_size / ON_FLAT_WALLS
    size[in_cell & ~flat] = mesh_size / ON_ROUND_WALLS
    # A dome that goes over into its wall would be distorted along its rim.
    dome = (region[first] == REGIONS["roof"]) & np.isin(patches.sheet[first], patches.sheets_with_borders)
    return np.minimum(size, radius / np.where(dome, CURVATURE_SAFETY, 1.0))


def _along(ends: np.ndarray, spacing: float) -> np.ndarray:
    """Points (N, 3) along E segments (E, 2, 3), no farther apart than ``spacing``."""
    count = np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / spacing).astype(int) + 1
    segment = np.repeat(np.arange(len(ends)), count)
    step = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
    fraction = step / np.maximum(count[segment] - 1, 1)
    return ends[segment, 0] + fraction[:, None] * (ends[segment, 1] - ends[segment, 0])
