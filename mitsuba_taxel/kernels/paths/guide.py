"""Path guiding: the scattering triangles to which `taxel_tracer` guides its paths.

In a domed cell about half of the light scattered by the roof falls on the absorbing board. Paths sampled from the BSDF
alone end there at random, which also destroys the gain of quasi-random points. So most next vertices are sampled on the
scattering triangles of the taxel's own cell instead: for Lambertian walls uniformly over their area, as in a sphere
every part of the wall illuminates all others equally; for isotropic walls with a density that falls with the distance,
as theirs does. Any density gives an unbiased estimate; only the variance depends on it.
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

_SHARE, _NEAR_SHARE = 0.85, 0.5  # of the directions that leave a guiding wall; the rest bounds the weights
_LEAST_RETURN = 0.1  # of the light that guiding walls scatter to each other; below it a guide costs more than it gains
_WORTHWHILE = 0.9  # of the mean square weight without a guide
_OTHER = -2  # in place of the taxel of a triangle that sends light back, but is none of a guide's


@dataclass(frozen=True)
class Members:
    """The triangles of a guide in sampling order: its part that does not depend on the load.

    So the same random numbers sample nearly the same points at neighbouring load steps, and a pad whose vertices were
    moved is read like one under the corresponding load.

    Attributes
    ----------
    owner : (N,) ndarray
        Taxel of each triangle; -1 for none, -2 for those of other walls that send light back.
    numbers : (M,) ndarray
        The triangles that have an owner.
    trees : MemberTrees
        Trees over them, one for each taxel.
    """

    owner: np.ndarray
    numbers: np.ndarray
    trees: MemberTrees


class Guide:
    """Scattering triangles of one mesh, sorted by the taxel that they belong to.

    A point is sampled by a k-d tree over each taxel's triangles, halved by number and weighted by area, so that
    neighbouring random numbers give neighbouring points.

    Parameters
    ----------
    mesh : mi.Mesh
    members : Members
        Its triangles, and their order.
    near : bool
        Whether near points are sampled more often than far ones.
    """

    def __init__(self, mesh: mi.Mesh, members: Members, near: bool) -> None:
        self.mesh = mi.ShapePtr(mesh)
        self.share = dr.opaque(mi.Float, _NEAR_SHARE if near else _SHARE)
        self.corners = _corners(mesh)
        self.near = near
        owner, numbers, trees = members.owner, members.numbers, members.trees
        a, b, c = self._corners(mi.UInt32(in_packets(numbers, np.uint32)))
        areas = np.array(0.5 * dr.norm(dr.cross(b - a, c - a)), dtype=float)
        shares = trees.shares(areas)
        self.depth = dr.opaque(mi.UInt32, trees.depth)
        self.shares = mi.Float(in_packets(shares))
        self.leaves = mi.UInt32(in_packets(numbers[trees.leaves], np.uint32))
        self.owner = mi.Int32(in_packets(owner, np.int32))
        self.area = mi.Float(in_packets(np.bincount(owner[numbers], areas, len(shares))))
        if near:
            boxes = np.zeros((len(owner), 4), np.float32)
            boxes[numbers] = trees.boxes(shares)
            self.boxes = mi.Float(in_packets(boxes))

    def sample(
        self, index: mi.UInt32, place: mi.Point2f, sample: mi.Point2f, nearness: mi.Float
    ) -> tuple[mi.Point3f, mi.UInt32]:
        """A point on the triangles of taxel ``index``, as seen from ``place``, and the number of its triangle.

        Parameters
        ----------
        place : mi.Point2f
            Origin of the ray on the unit square, see :meth:`place`; unused unless ``near``.
        sample, nearness : mi.Point2f and mi.Float
            Uniform random numbers.
        """
        if self.near:
            sample = place + (sample - place) * dr.minimum(2 * nearness, 1)
        return self.uniform(index, sample)

    def uniform(self, index: mi.UInt32, sample: mi.Point2f) -> tuple[mi.Point3f, mi.UInt32]:
        """A point uniform over the area of the triangles of taxel ``index``, and the number of its triangle."""
        leaf, rest = descend(self.shares, self.depth, index, sample)
        triangle = dr.gather(mi.UInt32, self.leaves, (index << self.depth) + leaf)
        a, b, c = self._corners(triangle)
        barycentric = mi.warp.square_to_uniform_triangle(rest)
        return dr.fma(b - a, barycentric.x, dr.fma(c - a, barycentric.y, a)), triangle

    def place(self, si: mi.SurfaceInteraction3f, member: mi.Bool) -> mi.Point2f:
        """The point of the unit square that :meth:`uniform` maps to a hit on one of the triangles."""
        if not self.near:
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

    def density(self, index: mi.UInt32, place: mi.Point2f, target: mi.Point2f) -> mi.Float:
        """Probability per area that :meth:`sample` returns the point at ``target``, both given by :meth:`place`.

        With s = min(2 nearness, 1) the density of place + s (sample - place) at a distance d from ``place`` is
        D / (2 d), where D is the distance from ``place`` to the rim of the unit square in that direction.
        """
        area = dr.gather(mi.Float, self.area, index)
        density = dr.select(area > 0, dr.rcp(area), 0)
        if not self.near:
            return density
        step = target - place
        to_rim = [dr.select(step[k] > 0, (1 - place[k]) / step[k], -place[k] / step[k]) for k in range(2)]
        reach = dr.minimum(*(dr.select(dr.abs(step[k]) > 1e-9, to_rim[k], 1e9) for k in range(2)))
        return density * 0.5 * dr.maximum(reach, 1)

    def normal(self, triangle: mi.UInt32) -> mi.Vector3f:
        """Unit normal of a triangle."""
        a, b, c = self._corners(triangle)
        return dr.normalize(dr.cross(b - a, c - a))

    def _corners(self, triangle: mi.UInt32, active: mi.Bool | bool = True) -> list[mi.Point3f]:
        return [dr.gather(mi.Point3f, self.corners, 3 * triangle + k, active) for k in range(3)]

    def contains(self, index: mi.UInt32, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Bool:
        """Whether a hit lies on the triangles of taxel ``index``."""
        return self._is_of(mi.Int32(index), si, active)

    def misses(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Bool:
        """Whether a hit lies on a wall of its mesh that sends light back, and that it never samples."""
        return self._is_of(mi.Int32(_OTHER), si, active)

    def _is_of(self, owner: mi.Int32, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Bool:
        here = active & (si.shape == self.mesh)
        return here & (dr.gather(mi.Int32, self.owner, si.prim_index, here) == owner)


def guide_for(scene: mi.Scene, pair: TaxelPair) -> Guide | None:
    """A guide for the Lambertian or else the isotropic walls in the cells of a pad, if it pays.

    Whether it pays is decided once, for the first position of the mesh, so that readings before and after a small
    change share their random numbers.

    Parameters
    ----------
    scene : mi.Scene
        With the pad.
    pair : TaxelPair
        At which paths end.

    Returns
    -------
    Guide or None
        None if it does not pay.
    """
    for mesh in scene.shapes():
        if mesh.is_mesh() and mesh.has_attribute("face_cell") and mesh.has_attribute("face_region"):
            positions = np.array(mi.traverse(mesh)["vertex_positions"])  # same variable after a pad has moved
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
    surface = mesh.undeformed if is_pad(mesh) else _surface_of(mesh)
    walls = _regions_by_wall(mesh.bsdf())
    sampled = tuple(walls["lambertian"] or walls["isotropic"])
    leds = np.array(pair.led.faces.centres).T
    taxels = np.argmin(np.linalg.norm(surface.middles[:, None] - leds[None], axis=2), axis=1)  # nearest to each cell
    members = _members(surface, sampled, tuple(walls["any"]), tuple(taxels.tolist()), pair.count)
    return None if members is None else Guide(mesh, members, near=not walls["lambertian"])


@kept(4)  # the scenes of a study share their undeformed pads
def _members(
    surface: CellSurface, regions: tuple[int, ...], lit: tuple[int, ...], taxels: tuple[int, ...], count: int
) -> Members | None:
    """The triangles in some regions, among those that send light back, of the cells of ``taxels``; None if they have no
    area or are flat."""
    corners, cell = surface.vertices[surface.triangles], surface.cell
    numbers = np.flatnonzero(np.isin(surface.region, regions) & (cell > 0) & (_areas(corners) > 0))
    if not len(numbers) or _is_flat(corners[numbers], cell[numbers]):
        return None
    taxel = np.array(taxels)[cell[numbers]]
    owner = np.where(np.isin(surface.region, lit), _OTHER, -1).astype(np.int32)
    owner[numbers] = taxel
    trees = MemberTrees(_unrolled(corners[numbers].mean(axis=1), taxel), taxel, count)
    return Members(owner, numbers.astype(np.uint32), trees)


def _surface_of(mesh: mi.Mesh) -> CellSurface:
    """The surface of a mesh that is not a `deformable_pad`, and so deforms only if a user moves it."""
    parameters = mi.traverse(mesh)
    vertices = np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3)
    region, cell = (np.rint(np.array(parameters[f"face_{name}"])).astype(int) for name in ("region", "cell"))
    return CellSurface(vertices, np.array(parameters["faces"]).reshape(-1, 3), region, cell)


def _corners(mesh: mi.Mesh) -> mi.Float:
    """(9 N,) coordinates of the corners of all triangles, triangle by triangle."""
    parameters = mi.traverse(mesh)
    faces, positions = parameters["faces"], dr.detach(parameters["vertex_positions"])
    number = dr.arange(mi.UInt32, 3 * len(faces))
    corners = dr.gather(mi.Float, positions, 3 * dr.gather(mi.UInt32, faces, number // 3) + number % 3)
    dr.eval(corners)
    return corners


def _areas(corners: np.ndarray) -> np.ndarray:
    """(N,) areas of triangles."""
    return 0.5 * np.linalg.norm(_normals(corners), axis=1)


def _normals(corners: np.ndarray) -> np.ndarray:
    """(N, 3) normals of triangles, with twice their areas as lengths."""
    first, second, third = corners.swapaxes(0, 1)
    return np.cross(second - first, third - first)


def _is_flat(corners: np.ndarray, cell: np.ndarray) -> bool:
    """Whether the triangles of each cell face one way, within some ten degrees, and so hardly see each other."""
    normals = _normals(corners)
    total = np.bincount(cell, np.linalg.norm(normals, axis=1))
    resultant = np.linalg.norm([np.bincount(cell, column) for column in normals.T], axis=0)
    return bool(np.all(resultant >= 0.98 * total))


def _regions_by_wall(bsdf: mi.BSDF) -> dict[str, list[int]]:
    """Codes of the regions that Lambertian and isotropic walls cover, and any that send light back, under a `region` or
    a single `wall`."""
    walls = bsdf.walls if is_region(bsdf) else dict.fromkeys(ALL_REGIONS, bsdf)
    found = {
        kind: [ALL_REGIONS[name] for name, wall in walls.items() if scatters(wall, kind)]
        for kind in ("lambertian", "isotropic")
    }
    return found | {"any": [ALL_REGIONS[name] for name, wall in walls.items() if not absorbs(wall)]}


def _gain(guide: Guide, scene: mi.Scene, pair: TaxelPair) -> float:
    """Factor by which the guide changes the mean square weight of a ray after one more reflection.

    Estimated with rays scattered from points of the guide. In a smooth dome it is about a half; where walls meet in
    corners most light goes to close-by walls, which the guide misses, and it exceeds 1. Light to other walls that send
    it back is sampled by scattering alone, and so counts by more: without a bound on the variance if these are large.
    """
    rays = 1 << 13
    rng = mi.PCG32(rays)
    taxel = dr.arange(mi.UInt32, rays) % dr.opaque(mi.UInt32, pair.count)
    from_ = mi.Point2f(rng.next_float32(), rng.next_float32())
    p, triangle = guide.uniform(taxel, from_)
    n = mi.Normal3f(guide.normal(triangle))
    sample = mi.Point2f(rng.next_float32(), rng.next_float32())
    if guide.near:
        local, scattered = mi.warp.square_to_uniform_hemisphere(sample), mi.Float(dr.inv_two_pi)
    else:
        local = mi.warp.square_to_cosine_hemisphere(sample)
        scattered = dr.inv_pi * local.z
    d = mi.Frame3f(n).to_world(local)
    si = scene.ray_intersect(leave(mi.Point3f(p), n, d, clearance_of(scene, pair)))
    seen = guide.contains(taxel, si, si.is_valid())
    scattered *= dr.abs(dr.dot(si.n, d)) / dr.square(si.t)
    drawn = guide.density(taxel, from_, guide.place(si, seen))
    weight = scattered / ((1 - guide.share) * scattered + guide.share * drawn)
    returned, other = dr.count(seen)[0], dr.count(guide.misses(si, si.is_valid()))[0]
    if returned <= _LEAST_RETURN * rays:
        return math.inf
    of_other = other / (1 - guide.share[0])
    return (float(dr.sum(dr.select(seen, weight, 0))[0]) + of_other) / (returned + other)


def _unrolled(points: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """(M, 2) map of points (M, 3) to a plane, such that neighbours stay neighbours.

    Seen along the axis of least extent of a taxel's points, each keeps its direction from the centre, and its distance
    from the point at the centre becomes its radius. On a sphere that is the equal-area map.
    """
    count = np.maximum(np.bincount(owner), 1)
    centre = np.stack([np.bincount(owner, column) / count for column in points.T], axis=1)
    deviation = points - centre[owner]
    flat = deviation @ np.linalg.eigh(deviation.T @ deviation)[1][:, :0:-1]
    radius = np.linalg.norm(flat, axis=1)
    middle = np.zeros_like(centre)
    inward = np.lexsort((-radius, owner))  # the last of each taxel is the one at its centre
    middle[owner[inward]] = points[inward]
    unrolled = np.linalg.norm(points - middle[owner], axis=1)
    return flat * (unrolled / np.maximum(radius, 1e-30))[:, None]
