"""Where light that a wall scatters may be scattered again: the triangles to which `taxel_tracer` guides its paths.

In a domed cell about half of what the roof scatters falls on the absorbing board. Paths that are drawn from the wall
alone end there at random, and that ends the gain of quasi-random points as well. So most of the next vertices are
drawn uniformly over the scattering triangles of the taxel's own cell instead. Any set of triangles gives an unbiased
estimate; only the scatter depends on it.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.optics.regions import ALL_REGIONS

_SHARE = 0.85  # of the directions that leave a wall of the guide; the rest bounds the weights
_LEAST_RETURN = 0.1  # of what the walls of the guide scatter to each other; below it a guide costs more than it gains


class Guide:
    """Scattering triangles of one mesh, sorted by the taxel that they belong to.

    A point is drawn through a k-d tree over each taxel's triangles, halved by number and weighted by area, so that
    neighbouring random numbers give neighbouring points.

    Parameters
    ----------
    mesh : the ``mi.Mesh``
    corners : (N, 3, 3) corners of all of its triangles
    owner : (N,) taxel of each triangle, -1 for none
    taxels : number of taxels
    """

    def __init__(self, mesh: Any, corners: np.ndarray, owner: np.ndarray, taxels: int) -> None:
        self.mesh = mi.ShapePtr(mesh)
        self.share = dr.opaque(mi.Float, _SHARE)
        areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        member = np.flatnonzero((owner >= 0) & (areas > 0))
        position = _principal_axes(corners[member].mean(axis=1), owner[member])
        shares, leaves = _trees(position, areas[member], owner[member], taxels)
        self.depth = int(leaves.shape[1]).bit_length() - 1
        self.shares = mi.Float(shares.ravel())
        self.leaves = mi.UInt32(member[leaves].astype(np.uint32).ravel())
        self.owner = mi.Int32(np.where(areas > 0, owner, -1).astype(np.int32))
        self.area = mi.Float(np.bincount(owner[member], areas[member], taxels))
        self.corners = mi.Float(corners.astype(np.float32).ravel())

    def sample(self, index: mi.UInt32, sample: mi.Point2f) -> mi.Point3f:
        """A point uniform over the area of the triangles of taxel ``index``."""
        u = [sample.x, sample.y]
        node = mi.UInt32(1)
        for level in range(self.depth):
            share = dr.gather(mi.Float, self.shares, (index << self.depth) + node)
            x = u[level % 2]
            right = x >= share
            x = dr.select(right, (x - share) / (1 - share), x / share)
            u[level % 2] = dr.clip(x, 0, dr.one_minus_epsilon(mi.Float))
            node = 2 * node + dr.select(right, mi.UInt32(1), mi.UInt32(0))
        leaf = dr.gather(mi.UInt32, self.leaves, (index << self.depth) + node - (1 << self.depth))
        a, b, c = (dr.gather(mi.Point3f, self.corners, 3 * leaf + k) for k in range(3))
        barycentric = mi.warp.square_to_uniform_triangle(mi.Point2f(*u))
        return dr.fma(b - a, barycentric.x, dr.fma(c - a, barycentric.y, a))

    def contains(self, index: mi.UInt32, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Bool:
        """Whether a hit lies on the triangles of taxel ``index``."""
        here = active & (si.shape == self.mesh)
        return here & (dr.gather(mi.Int32, self.owner, si.prim_index, here) == mi.Int32(index))

    def density(self, index: mi.UInt32) -> mi.Float:
        """Probability per area of a point of taxel ``index``; 0 where it has no triangles."""
        area = dr.gather(mi.Float, self.area, index)
        return dr.select(area > 0, dr.rcp(area), 0)


def guide_for(scene: mi.Scene, pair: Any) -> Guide | None:
    """A guide for the Lambertian walls in the cells of a pad, if enough of their light comes back to them.

    Isotropic walls have none: they scatter most to the surface close by, which points drawn by area miss.
    """
    for mesh in scene.shapes():
        if mesh.is_mesh() and mesh.has_attribute("face_cell") and mesh.has_attribute("face_region"):
            parameters = mi.traverse(mesh)
            positions = parameters["vertex_positions"]
            known = getattr(pair.sensor, "guide", (None, None))
            if known[0] is None or known[0].index != positions.index:
                pair.sensor.guide = known = (positions, _guide_on(mesh, parameters, pair))
            return known[1]
    return None


def _guide_on(mesh: Any, parameters: Any, pair: Any) -> Guide | None:
    vertices = np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3)
    triangles = np.array(parameters["faces"]).reshape(-1, 3)
    region = np.rint(np.array(parameters["face_region"])).astype(int)
    cell = np.rint(np.array(parameters["face_cell"])).astype(int)
    member = np.isin(region, _lambertian_regions(mesh.bsdf())) & (cell > 0)
    if not member.any():
        return None
    corners = vertices[triangles]
    taxel = _taxel_of_cells(corners.mean(axis=1)[member], cell[member], pair.led.faces)
    owner = np.full(len(triangles), -1)
    owner[member] = taxel[cell[member]]
    if _return(corners[member], cell[member]) < _LEAST_RETURN:
        return None
    return Guide(mesh, corners, owner, pair.count)


def _lambertian_regions(bsdf: Any) -> list[int]:
    """Codes of the regions that a Lambertian `wall` covers, under a `region` or a single `wall`."""
    walls = getattr(bsdf, "walls", None)
    if walls is None:
        walls = dict.fromkeys(ALL_REGIONS, bsdf)
    return [ALL_REGIONS[name] for name, wall in walls.items() if getattr(wall, "scattering", "") == "lambertian"]


def _taxel_of_cells(centres: np.ndarray, cell: np.ndarray, faces: Any) -> np.ndarray:
    """(largest cell + 1,) the taxel whose LED is nearest to the middle of each cell."""
    count = np.maximum(np.bincount(cell), 1)
    middle = np.stack([np.bincount(cell, column) / count for column in centres.T], axis=1)
    leds = np.array(faces.centres).T
    return np.argmin(np.linalg.norm(middle[:, None] - leds[None], axis=2), axis=1)


def _return(corners: np.ndarray, cell: np.ndarray) -> float:
    """Estimate of the share of what the triangles scatter that other triangles of their cell receive, walls apart."""
    rng = np.random.default_rng(0)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    first = rng.choice(len(areas), 4096, p=areas / areas.sum())
    second = rng.choice(len(areas), 4096, p=areas / areas.sum())
    same = (cell[first] == cell[second]) & (first != second)
    first, second = first[same], second[same]
    d = corners[second].mean(axis=1) - corners[first].mean(axis=1)
    distance_squared = (d**2).sum(axis=1)
    cosines = [
        np.einsum("ij,ij->i", normals[end], sign * d) / (2 * areas[end]) for end, sign in ((first, 1), (second, -1))
    ]
    facing = (cosines[0] > 0) & (cosines[1] > 0)
    cell_area = areas.sum() / len(np.unique(cell))
    kernel = np.where(facing, cosines[0] * cosines[1] / (np.pi * distance_squared**2), 0)
    return float(np.mean(np.minimum(kernel * cell_area, 4.0))) if len(kernel) else 0.0


def _trees(centres: np.ndarray, areas: np.ndarray, owner: np.ndarray, taxels: int) -> tuple[np.ndarray, np.ndarray]:
    """Implicit k-d trees of all taxels: at each node (counted from 1) the share of its area that lies on the left.

    Parameters
    ----------
    centres, areas, owner : (M, 2) positions along the axes of the splits, (M,) areas and (M,) taxels of the members

    Returns
    -------
    shares : (taxels, 2**depth); leaves : (taxels, 2**depth) number of the member in each leaf
    """
    depth = max(1, int(np.bincount(owner).max() - 1).bit_length())
    shares, leaves = np.ones((taxels, 1 << depth), np.float32), np.zeros((taxels, 1 << depth), np.uint32)
    node = np.ones(len(areas), dtype=np.int64)
    for level in range(depth):
        place = (owner << level) + node - (1 << level)  # one number for each node of this level
        order = np.lexsort((centres[:, level % 2], place))
        count = np.bincount(place, minlength=taxels << level)
        first = np.cumsum(count) - count
        rank = np.empty_like(node)
        rank[order] = np.arange(len(areas)) - first[place[order]]
        right = rank >= count[place] // 2
        whole = np.bincount(place, areas, taxels << level)
        left = np.bincount(place[~right], areas[~right], taxels << level)
        share = np.divide(left, whole, out=np.ones_like(left), where=whole > 0)
        shares[:, 1 << level : 2 << level] = share.reshape(taxels, -1)
        node = 2 * node + right
    leaves[owner, node - (1 << depth)] = np.arange(len(areas))
    return shares, leaves


def _principal_axes(points: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """(M, 2) coordinates of points (M, 3) along the two axes in which the points of one taxel lie widest."""
    count = np.maximum(np.bincount(owner), 1)
    centre = np.stack([np.bincount(owner, column) / count for column in points.T], axis=1)
    deviation = points - centre[owner]
    return deviation @ np.linalg.eigh(deviation.T @ deviation)[1][:, :0:-1]
