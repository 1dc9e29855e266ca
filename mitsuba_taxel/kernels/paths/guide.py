"""Path guiding: the scattering triangles to which `taxel_tracer` guides its paths.

In a domed cell about half of the light scattered by the roof is absorbed by the board. Paths sampled from the BSDF
alone end there at random, which also destroys the gain of quasi-random points. Most next vertices are therefore sampled
on the scattering triangles of the taxel's own cell. For Lambertian walls they are sampled uniformly by area, as each
area of a sphere illuminates all others equally; for isotropic walls with a density that decreases with the distance, as
the scattered light does. Any density gives an unbiased estimate; only the variance depends on it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.kernels.paths.ray_offsets import clearance_of, leave
from mitsuba_taxel.kernels.paths.sample_warping import MemberTrees, descend
from mitsuba_taxel.kernels.protocols import is_pad, is_region
from mitsuba_taxel.kernels.surfaces.cell_surface import CellSurface
from mitsuba_taxel.kernels.surfaces.regions import ALL_REGIONS
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.walls import absorbs, scatters

_GUIDED, _GUIDED_NEAR = 0.85, 0.5  # probability of a guided direction, uniform and by distance; the rest bounds weights
_LEAST_RETURN = 0.1  # fraction of light scattered from guiding walls to guiding walls below which a guide does not pay
_WORTHWHILE = 0.9  # mean square weight with a guide, relative to that without, below which a guide pays
_UNSAMPLED = -2  # owner of a triangle that reflects light but is not sampled by a guide


@dataclass(frozen=True)
class Members:
    """The triangles of a pad's surface to which light paths are guided, in an order that is independent of the load.

    The same random numbers therefore sample nearly the same points at neighbouring load steps, and a pad whose vertices
    were moved gives the readings of a pad under the corresponding load.

    Attributes
    ----------
    owner : (N,) ndarray
        Taxel of each of N triangles; -1 for none, -2 for triangles of other walls that reflect light.
    numbers : (M,) ndarray
        Numbers of the M triangles that belong to a taxel.
    trees : MemberTrees
        A tree of these triangles for each taxel.
    """

    owner: np.ndarray
    numbers: np.ndarray
    trees: MemberTrees


class Guide:
    """Guides light paths: samples the next vertex of a path on those triangles of the same taxel that scatter light.

    A point is sampled by a k-d tree over the triangles of a taxel, halved by number and weighted by area, so that
    neighbouring random numbers give neighbouring points.

    Parameters
    ----------
    mesh : mi.Mesh
        The mesh.
    members : Members
        Triangles of the guide, and their order.
    by_distance : bool
        Whether near points are sampled more often than distant points.
    """

    def __init__(self, mesh: mi.Mesh, members: Members, by_distance: bool) -> None:
        self.mesh = mi.ShapePtr(mesh)
        self.probability = dr.opaque(mi.Float, _GUIDED_NEAR if by_distance else _GUIDED)
        self.corners = _corners(mesh)
        self.by_distance = by_distance
        owner, numbers, trees = members.owner, members.numbers, members.trees
        a, b, c = self._corners(mi.UInt32(in_packets(numbers, np.uint32)))
        areas = np.array(0.5 * dr.norm(dr.cross(b - a, c - a)), dtype=float)
        splits = trees.splits(areas)
        self.depth = dr.opaque(mi.UInt32, trees.depth)
        self.splits = mi.Float(in_packets(splits))
        self.leaves = mi.UInt32(in_packets(numbers[trees.leaves], np.uint32))
        self.owner = mi.Int32(in_packets(owner, np.int32))
        self.area = mi.Float(in_packets(np.bincount(owner[numbers], areas, len(splits))))
        if by_distance:
            boxes = np.zeros((len(owner), 4), np.float32)
            boxes[numbers] = trees.boxes(splits)
            self.boxes = mi.Float(in_packets(boxes))

    def sample(
        self, index: mi.UInt32, uv: mi.Point2f, sample: mi.Point2f, nearness: mi.Float
    ) -> tuple[mi.Point3f, mi.UInt32]:
        """Sample a point on the scattering triangles of a taxel.

        Parameters
        ----------
        index : mi.UInt32
            Number of the taxel.
        uv : mi.Point2f
            Origin of the ray, mapped to the unit square by :meth:`uv`; only used if points are sampled by distance.
        sample, nearness : mi.Point2f and mi.Float
            Uniform random numbers.

        Returns
        -------
        point, triangle : mi.Point3f and mi.UInt32
            World position, and number of the triangle.
        """
        if self.by_distance:
            sample = uv + (sample - uv) * dr.minimum(2 * nearness, 1)
        return self.uniform(index, sample)

    def uniform(self, index: mi.UInt32, sample: mi.Point2f) -> tuple[mi.Point3f, mi.UInt32]:
        """A point distributed uniformly over the guiding triangles of taxel ``index``, and the number of its triangle.
        """
        leaf, rest = descend(self.splits, self.depth, index, sample)
        triangle = dr.gather(mi.UInt32, self.leaves, (index << self.depth) + leaf)
        a, b, c = self._corners(triangle)
        barycentric = mi.warp.square_to_uniform_triangle(rest)
        return dr.fma(b - a, barycentric.x, dr.fma(c - a, barycentric.y, a)), triangle

    def uv(self, si: mi.SurfaceInteraction3f, member: mi.Bool) -> mi.Point2f:
        """Point of the unit square that :meth:`uniform` maps to a hit ``si`` on a triangle; the inverse of
        :meth:`uniform`.
        """
        if not self.by_distance:
            return mi.Point2f(0)
        a, b, c = self._corners(si.prim_index, member)
        u, v, w = b - a, c - a, si.p - a
        uu, uv, vv, wu, wv = dr.dot(u, u), dr.dot(u, v), dr.dot(v, v), dr.dot(w, u), dr.dot(w, v)
        determinant = dr.maximum(uu * vv - dr.square(uv), 1e-30)
        barycentric = mi.Point2f(vv * wu - uv * wv, uu * wv - uv * wu) / determinant
        x = dr.clip(1 - dr.square(1 - barycentric.x), 0, 1)
        y = dr.clip(barycentric.y / dr.maximum(1 - barycentric.x, 1e-6), 0, 1)
        low = [dr.gather(mi.Float, self.boxes, 4 * si.prim_index + k, member) for k in range(4)]
        return mi.Point2f(dr.fma(x, low[2], low[0]), dr.fma(y, low[3], low[1]))

    def density(self, index: mi.UInt32, uv: mi.Point2f, target: mi.Point2f) -> mi.Float:
        """Probability density per area, 1/mm², with which :meth:`sample` returns a given point of the triangles.

        With s = min(2 nearness, 1), the density of uv + s (sample - uv) at a distance d from ``uv`` is D / (2 d), where
        D is the distance from ``uv`` to the edge of the unit square in that direction.

        Parameters
        ----------
        index : mi.UInt32
            Number of the taxel.
        uv, target : mi.Point2f
            Origin and sampled point on the unit square, see :meth:`uv`.
        """
        area = dr.gather(mi.Float, self.area, index)
        density = dr.select(area > 0, dr.rcp(area), 0)
        if not self.by_distance:
            return density
        step = target - uv
        to_rim = [dr.select(step[k] > 0, (1 - uv[k]) / step[k], -uv[k] / step[k]) for k in range(2)]
        reach = dr.minimum(*(dr.select(dr.abs(step[k]) > 1e-9, to_rim[k], 1e9) for k in range(2)))
        return density * 0.5 * dr.maximum(reach, 1)

    def normal(self, triangle: mi.UInt32) -> mi.Vector3f:
        """Unit normal of a triangle."""
        a, b, c = self._corners(triangle)
        return dr.normalize(dr.cross(b - a, c - a))

    def _corners(self, triangle: mi.UInt32, active: mi.Bool | bool = True) -> list[mi.Point3f]:
        """The three corners (3 points, world coordinates) of a triangle."""
        return [dr.gather(mi.Point3f, self.corners, 3 * triangle + k, active) for k in range(3)]

    def contains(self, index: mi.UInt32, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Bool:
        """Mask of the hits ``si`` that lie on a guiding triangle of taxel ``index``."""
        return self._is_of(mi.Int32(index), si, active)

    def misses(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Bool:
        """Mask of the hits ``si`` on walls of the mesh that reflect light, but to which the guide never samples a path.
        """
        return self._is_of(mi.Int32(_UNSAMPLED), si, active)

    def _is_of(self, owner: mi.Int32, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Bool:
        on_mesh = active & (si.shape == self.mesh)
        return on_mesh & (dr.gather(mi.Int32, self.owner, si.prim_index, on_mesh) == owner)


def guide_for(scene: mi.Scene, pair: TaxelPair) -> Guide | None:
    """The guide to the Lambertian walls in the cells of a pad, or to the isotropic walls if none are Lambertian.

    Whether a guide reduces the variance is decided once, for the first position of the mesh, so that readings before
    and after a small change use the same random numbers.

    Parameters
    ----------
    scene : mi.Scene
        Scene with the pad.
    pair : TaxelPair
        LED and phototransistor of the paths.

    Returns
    -------
    Guide or None
        The guide; None if a guide does not reduce the variance.
    """
    for mesh in scene.shapes():
        if mesh.is_mesh() and mesh.has_attribute("face_cell") and mesh.has_attribute("face_region"):
            positions = np.array(mi.traverse(mesh)["vertex_positions"])
            guide: Guide | None
            if pair.sensor.guide is None:
                guide = _guide_on(mesh, pair)
                pays = guide is not None and _gain(guide, scene, pair) < _WORTHWHILE
                pair.sensor.guide = (positions, guide if pays else None)
            elif not np.array_equal(pair.sensor.guide[0], positions):
                pair.sensor.guide = (positions, pair.sensor.guide[1] and _guide_on(mesh, pair))
            guide = pair.sensor.guide[1]
            return guide
    return None


def _guide_on(mesh: mi.Mesh, pair: TaxelPair) -> Guide | None:
    """The guide to the scattering walls of a mesh; None without such walls, or if the cells are flat."""
    surface = mesh.undeformed if is_pad(mesh) else _surface_of(mesh)
    walls = _regions_by_wall(mesh.bsdf())
    sampled = tuple(walls["lambertian"] or walls["isotropic"])
    # A cell belongs to the taxel with the nearest LED.
    leds = np.array(pair.led.faces.centres).T
    taxels = np.argmin(np.linalg.norm(surface.middles[:, None] - leds[None], axis=2), axis=1)
    members = _members(surface, sampled, tuple(walls["any"]), tuple(taxels.tolist()), pair.count)
    return None if members is None else Guide(mesh, members, by_distance=not walls["lambertian"])


@kept(4)  # the scenes of a study share their undeformed pads
def _members(
    surface: CellSurface, regions: tuple[int, ...], lit: tuple[int, ...], taxels: tuple[int, ...], count: int
) -> Members | None:
    """The triangles that a guide samples; None if they have no area or are flat.

    Parameters
    ----------
    surface : CellSurface
        The undeformed surface.
    regions, lit : tuple[int, ...]
        Codes of the regions that are sampled, and of those that reflect light.
    taxels : tuple[int, ...]
        Taxel of each cell.
    count : int
        Number of taxels.
    """
    corners, cell = surface.vertices[surface.triangles], surface.cell
    numbers = np.flatnonzero(
        np.isin(surface.region, regions) & (cell > 0) & (np.linalg.norm(_normals(corners), axis=1) > 0)
    )
    if not len(numbers) or _is_flat(corners[numbers], cell[numbers]):
        return None
    taxel = np.array(taxels)[cell[numbers]]
    owner = np.where(np.isin(surface.region, lit), _UNSAMPLED, -1).astype(np.int32)
    owner[numbers] = taxel
    trees = MemberTrees(_unrolled(corners[numbers].mean(axis=1), taxel), taxel, count)
    return Members(owner, numbers.astype(np.uint32), trees)


def _surface_of(mesh: mi.Mesh) -> CellSurface:
    """The surface of a mesh that is not a `deformable_pad`; this package never changes such a mesh."""
    parameters = mi.traverse(mesh)
    vertices = np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3)
    region, cell = (np.rint(np.array(parameters[f"face_{name}"])).astype(int) for name in ("region", "cell"))
    return CellSurface(vertices, np.array(parameters["faces"]).reshape(-1, 3), region, cell)


def _corners(mesh: mi.Mesh) -> mi.Float:
    """Coordinates (9 N,) of the corners of all N triangles of a mesh, in the order of the triangles."""
    parameters = mi.traverse(mesh)
    faces, positions = parameters["faces"], dr.detach(parameters["vertex_positions"])
    number = dr.arange(mi.UInt32, 3 * len(faces))
    corners = dr.gather(mi.Float, positions, 3 * dr.gather(mi.UInt32, faces, number // 3) + number % 3)
    dr.eval(corners)
    return corners


def _normals(corners: np.ndarray) -> np.ndarray:
    """Normals (N, 3) of N triangles; their lengths are twice the areas."""
    first, second, third = corners.swapaxes(0, 1)
    return np.cross(second - first, third - first)


def _is_flat(corners: np.ndarray, cell: np.ndarray) -> bool:
    """Whether the triangles of each cell are parallel within about ten degrees, so that little light passes between."""
    normals = _normals(corners)
    total = np.bincount(cell, np.linalg.norm(normals, axis=1))
    resultant = np.linalg.norm([np.bincount(cell, column) for column in normals.T], axis=0)
    return bool(np.all(resultant >= 0.98 * total))


def _regions_by_wall(bsdf: mi.BSDF) -> dict[str, list[int]]:
    """Codes of the regions with Lambertian walls, with isotropic walls, and with any wall that reflects light.

    The BSDF is a `region` or the wall of all regions.
    """
    walls = bsdf.walls if is_region(bsdf) else dict.fromkeys(ALL_REGIONS, bsdf)
    regions = {
        kind: [ALL_REGIONS[name] for name, wall in walls.items() if scatters(wall, kind)]
        for kind in ("lambertian", "isotropic")
    }
    return regions | {"any": [ALL_REGIONS[name] for name, wall in walls.items() if not absorbs(wall)]}


def _gain(guide: Guide, scene: mi.Scene, pair: TaxelPair) -> float:
    """Mean square weight of rays that are sampled with the guide, relative to that of rays sampled without it, after
    one more reflection.

    It is estimated with rays scattered from points of the guide. In a smooth dome it is about a half. Where walls meet
    in corners it exceeds 1, as most light goes to close walls, which the guide misses. Light to other walls that
    reflect is sampled by scattering alone, which increases its weight: the variance is unbounded if these walls are
    large.
    """
    # Rays scattered from uniformly distributed points of the guide.
    rays = 1 << 13
    rng = mi.PCG32(rays)
    taxel = dr.arange(mi.UInt32, rays) % dr.opaque(mi.UInt32, pair.count)
    uv = mi.Point2f(rng.next_float32(), rng.next_float32())
    p, triangle = guide.uniform(taxel, uv)
    n = mi.Normal3f(guide.normal(triangle))
    sample = mi.Point2f(rng.next_float32(), rng.next_float32())
    if guide.by_distance:
        local, scattered = mi.warp.square_to_uniform_hemisphere(sample), mi.Float(dr.inv_two_pi)
    else:
        local = mi.warp.square_to_cosine_hemisphere(sample)
        scattered = dr.inv_pi * local.z
    d = mi.Frame3f(n).to_world(local)
    si = scene.ray_intersect(leave(mi.Point3f(p), n, d, clearance_of(scene, pair)))

    # Weights of rays that hit the guide, with the density of scattering and guide combined.
    hits = guide.contains(taxel, si, si.is_valid())
    scattered *= dr.abs(dr.dot(si.n, d)) / dr.square(si.t)
    guide_density = guide.density(taxel, uv, guide.uv(si, hits))
    weight = scattered / ((1 - guide.probability) * scattered + guide.probability * guide_density)
    returned, missed = dr.count(hits)[0], dr.count(guide.misses(si, si.is_valid()))[0]
    if returned <= _LEAST_RETURN * rays:
        return math.inf
    missed_weight = missed / (1 - guide.probability[0])
    return (float(dr.sum(dr.select(hits, weight, 0))[0]) + missed_weight) / (returned + missed)


def _unrolled(points: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Map M points (M, 3) to a plane (M, 2) so that neighbours remain neighbours.

    Points of a taxel are projected along the axis of their least extent. Each point keeps its direction from the
    centre; its distance from the point at the centre becomes its radius. On a sphere this is the equal-area map.
    """
    count = np.maximum(np.bincount(owner), 1)
    centre = np.stack([np.bincount(owner, column) / count for column in points.T], axis=1)
    deviation = points - centre[owner]
    flat = deviation @ np.linalg.eigh(deviation.T @ deviation)[1][:, :0:-1]
    radius = np.linalg.norm(flat, axis=1)
    middle = np.zeros_like(centre)
    inward = np.lexsort((-radius, owner))  # the last point of each taxel is the point at its centre
    middle[owner[inward]] = points[inward]
    unrolled = np.linalg.norm(points - middle[owner], axis=1)
    return flat * (unrolled / np.maximum(radius, 1e-30))[:, None]
