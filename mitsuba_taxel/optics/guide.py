"""Where light that a wall scatters may be scattered again: the triangles to which `taxel_tracer` guides its paths.

In a domed cell about half of what the roof scatters falls on the absorbing board. Paths that are drawn from the wall
alone end there at random, and that ends the gain of quasi-random points as well. So most of the next vertices are
drawn uniformly over the scattering triangles of the taxel's own cell instead. Any set of triangles gives an unbiased
estimate; only the scatter depends on it.
"""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.optics.regions import ALL_REGIONS
from mitsuba_taxel.optics.tracing import clearance_of, leave
from mitsuba_taxel.optics.trees import descend, shares_of_members

_SHARE = 0.85  # of the directions that leave a wall of the guide; the rest bounds the weights
_LEAST_RETURN = 0.1  # of what the walls of the guide scatter to each other; below it a guide costs more than it gains
_WORTHWHILE = 0.8  # of the mean square weight without a guide


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
        shares, leaves = shares_of_members(position, areas[member], owner[member], taxels)
        self.depth = int(leaves.shape[1]).bit_length() - 1
        self.shares = mi.Float(shares.ravel())
        self.leaves = mi.UInt32(member[leaves].astype(np.uint32).ravel())
        self.owner = mi.Int32(np.where(areas > 0, owner, -1).astype(np.int32))
        self.area = mi.Float(np.bincount(owner[member], areas[member], taxels))
        self.corners = mi.Float(corners.astype(np.float32).ravel())

    def sample(self, index: mi.UInt32, sample: mi.Point2f) -> tuple[mi.Point3f, mi.UInt32]:
        """A point uniform over the area of the triangles of taxel ``index``, and the number of its triangle."""
        leaf, rest = descend(self.shares, self.depth, index, sample)
        triangle = dr.gather(mi.UInt32, self.leaves, (index << self.depth) + leaf)
        a, b, c = (dr.gather(mi.Point3f, self.corners, 3 * triangle + k) for k in range(3))
        barycentric = mi.warp.square_to_uniform_triangle(rest)
        return dr.fma(b - a, barycentric.x, dr.fma(c - a, barycentric.y, a)), triangle

    def normal(self, triangle: mi.UInt32) -> mi.Vector3f:
        """Unit normal of a triangle."""
        a, b, c = (dr.gather(mi.Point3f, self.corners, 3 * triangle + k) for k in range(3))
        return dr.normalize(dr.cross(b - a, c - a))

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
                pair.sensor.guide = known = (positions, _guide_on(scene, mesh, parameters, pair))
            return known[1]
    return None


def _guide_on(scene: Any, mesh: Any, parameters: Any, pair: Any) -> Guide | None:
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
    guide = Guide(mesh, corners, owner, pair.count)
    return guide if _gain(guide, scene, pair) < _WORTHWHILE else None


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


def _gain(guide: Guide, scene: mi.Scene, pair: Any) -> float:
    """By how much the guide multiplies the mean square of the weight that a ray has after one more reflection.

    Found by rays from points of the guide after the cosine law. In a smooth dome the ratio is about a half; where walls
    meet in corners most light goes to walls close by, which points drawn by area miss, and the ratio exceeds 1.
    """
    rays = 1 << 13
    rng = mi.PCG32(rays)
    taxel = dr.arange(mi.UInt32, rays) % dr.opaque(mi.UInt32, pair.count)
    p, triangle = guide.sample(taxel, mi.Point2f(rng.next_float32(), rng.next_float32()))
    n = mi.Normal3f(guide.normal(triangle))
    local = mi.warp.square_to_cosine_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32()))
    d = mi.Frame3f(n).to_world(local)
    si = scene.ray_intersect(leave(mi.Point3f(p), n, d, clearance_of(pair)))
    seen = guide.contains(taxel, si, si.is_valid())
    kernel = dr.inv_pi * local.z * dr.abs(dr.dot(si.n, d)) / (dr.square(si.t) * guide.density(taxel))
    weight = kernel / ((1 - guide.share) * kernel + guide.share)
    without = dr.count(seen)[0]
    return float(dr.sum(dr.select(seen, weight, 0))[0]) / without if without > _LEAST_RETURN * rays else math.inf


def _principal_axes(points: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """(M, 2) coordinates of points (M, 3) along the two axes in which the points of one taxel lie widest."""
    count = np.maximum(np.bincount(owner), 1)
    centre = np.stack([np.bincount(owner, column) / count for column in points.T], axis=1)
    deviation = points - centre[owner]
    return deviation @ np.linalg.eigh(deviation.T @ deviation)[1][:, :0:-1]
