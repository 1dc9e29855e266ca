"""Differences of readings of two states of a scene, by paths whose vertices are points of the material.

A path is sampled in one state, and its vertices are moved with the material to the other state: the triangle and the
barycentric coordinates of each vertex on a pad are kept, and points of all other objects stay in place. The difference
of the contributions of both paths is then as small as the difference of the states. Paths that are traced with the same
random numbers, in contrast, diverge after a few reflections. Half of the paths are sampled in each state. With
densities p and q of a path in both states and contributions f and g, each path counts (g - f) / (p + q) (the balance
heuristic of E. Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997, chapter 9; shift mappings by
reconnection: J. Lehtinen et al., Gradient-Domain Metropolis Light Transport, 2013). The estimate is unbiased, even if
walls hide different light in both states, and bounded.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.kernels.paths.ray_offsets import between, clearance_of, leave, release
from mitsuba_taxel.kernels.paths.wavefronts import LARGEST_WAVEFRONT, sum_blocks
from mitsuba_taxel.kernels.taxel_pair import TaxelPair

LEAST_DEPTH, SURVIVAL = 12, 0.9
"""Number of reflections after which paths end at random, and the probability with which they continue. It does not
depend on the path, and is thus the same in both states."""


class PairedState:
    """One of two states of a scene whose difference of readings is computed; the scene has one pad.

    Parameters
    ----------
    scene : mi.Scene
        The loaded scene.
    pad : mi.Mesh
        Its pad, whose triangles are those of the other state.
    """

    def __init__(self, scene: mi.Scene, pad: mi.Mesh) -> None:
        self.scene, self.pad = scene, mi.ShapePtr(pad)
        dr.make_opaque(self.pad)
        parameters = mi.traverse(pad)
        self._faces, self._positions = parameters["faces"], parameters["vertex_positions"]
        self._normals = parameters["vertex_normals"] if pad.has_vertex_normals() else None

    def point(self, triangle: mi.UInt32, uv: mi.Point2f, active: mi.Bool) -> _Point:
        """The position, in this state, of a point of the pad's surface that is given by its triangle and barycentric
        coordinates.
        """
        numbers = dr.gather(mi.Vector3u, self._faces, triangle, active)
        a, b, c = (mi.Point3f(dr.gather(mi.Point3f, self._positions, number, active)) for number in numbers)
        across = dr.cross(b - a, c - a)
        area = dr.norm(across)
        normal = mi.Normal3f(across / area)
        shading = normal
        if self._normals is not None:
            p, q, r = (mi.Normal3f(dr.gather(mi.Normal3f, self._normals, number, active)) for number in numbers)
            shading = dr.normalize(dr.fma(p, 1 - uv.x - uv.y, dr.fma(q, uv.x, r * uv.y)))
        return _Point(dr.fma(b - a, uv.x, dr.fma(c - a, uv.y, a)), normal, shading, area)


@dataclass
class _Point:
    """A point of a surface: position, normals of triangle and wall, and twice the area of its triangle in mm²."""

    p: mi.Point3f
    n: mi.Normal3f
    shading: mi.Normal3f
    area: mi.Float


def trace_difference(
    first: PairedState,
    second: PairedState,
    pair: TaxelPair,
    points: int,
    seed: int,
    replicates: int,
    first_point: int = 0,
) -> np.ndarray:
    """Differences of readings of two states of a scene (the second minus the first), by paths through the same material
    points.

    Parameters
    ----------
    first, second : PairedState
        The states, which have LEDs, phototransistors and packages in common.
    pair : TaxelPair
        LED and phototransistor of the first state, without windows.
    points : int
        Paths for each reading and replicate in each state; rounded up to a power of two.
    seed : int
        Seed of the random numbers.
    replicates : int
        Number of independent randomisations.
    first_point : int
        Number of the first point, 0 or a multiple of ``points``, to continue an earlier run.

    Returns
    -------
    (replicates, taxels) ndarray
        Differences of the readings in W.
    """
    sampler = pair.sensor.sampler().fork()
    sampler.set_sample_count(points)
    points, taxels = sampler.sample_count(), pair.count
    sums = np.zeros(taxels * replicates)
    at_once = max(1, LARGEST_WAVEFRONT // points)
    for start in range(0, len(sums), at_once):
        sequences = min(at_once, len(sums) - start)
        for base, other, sign in ((first, second, 1), (second, first, -1)):
            sampler.place(first_point, start)
            sampler.seed(seed, sequences * points)
            index = sampler.sequence % dr.opaque(mi.UInt32, taxels)
            change = _changes(base, other, pair, index, sampler)
            sums[start : start + sequences] += sign * sum_blocks(change, points)
    return (sums / points).reshape(replicates, taxels)


@dr.syntax
def _changes(base: PairedState, other: PairedState, pair: TaxelPair, index: mi.UInt32, sampler: mi.Sampler):
    """Contributions (g - f) / (p + q) in W of paths sampled in the state ``base``: f and p are contribution and density
    of a path there, g and q those of the moved path in the state ``other``."""
    led, sensor = pair.led, pair.sensor
    clearance = clearance_of(base.scene, pair)
    context = mi.BSDFContext(mi.TransportMode.Importance)
    result = dr.zeros(mi.Float, dr.width(index))

    # ---------------------- Emission ----------------------
    # The present vertex in both states; f / p of the base state, g / f and q / p; value and density of the direction.
    vertex = mi.Point3f(led.sample_point(index, sampler.next_2d()))
    normal = mi.Normal3f(led.faces.frame.n)
    moved, moved_normal = mi.Point3f(vertex), mi.Normal3f(normal)
    direction = mi.Vector3f(led.sample_direction_of_emission(sampler.next_2d()))
    density = mi.Float(led.density_of_direction(direction))
    value = mi.Float(density)
    throughput = mi.Float(led.power) + result
    of_values, of_densities = mi.Float(1) + result, mi.Float(1) + result
    at_moved = dr.zeros(mi.SurfaceInteraction3f, dr.width(index))
    bsdf = dr.zeros(mi.BSDFPtr, dr.width(index))
    ray = release(vertex, normal, direction, clearance)
    depth, active = mi.UInt32(0), density > 0
    while active:
        # ---------------------- Next vertex, and its place in the other state ----------------------
        hit = base.scene.ray_intersect_preliminary(ray, active=active)
        si = hit.compute_surface_interaction(ray, active=active)
        active &= si.is_valid()
        on_pad = active & (si.shape == base.pad)
        here, there = (state.point(hit.prim_index, hit.prim_uv, on_pad) for state in (base, other))
        at_next = mi.SurfaceInteraction3f(si)
        at_next.p = dr.select(on_pad, there.p, si.p)
        at_next.n = dr.select(on_pad, there.n, si.n)
        at_next.sh_frame = mi.Frame3f(dr.select(on_pad, there.shading, si.sh_frame.n))
        step = at_next.p - moved
        onward = dr.normalize(step)
        at_next.wi = at_next.to_local(-onward)

        # ---------------------- Ratios of values and densities ----------------------
        emitted = led.density_of_direction(onward)
        scattered, drawn = bsdf.eval_pdf(context, at_moved, at_moved.to_local(onward), active & (depth > 0))
        other_value = dr.select(depth == 0, emitted, scattered[0])
        other_density = dr.select(depth == 0, emitted, drawn)
        geometry = dr.abs(dr.dot(at_next.n, onward)) / dr.squared_norm(step)
        geometry *= dr.squared_norm(si.p - vertex) / dr.abs(dr.dot(si.n, direction))
        geometry *= dr.select(on_pad, there.area / here.area, 1)
        probe = between(moved, moved_normal, onward, clearance, at_next.p, at_next.n)
        seen = active & (of_densities > 0) & (other_density > 0)
        seen &= ~other.scene.ray_test(probe, seen)
        of_values = dr.select(seen, of_values * other_value / value * geometry, 0)
        of_densities = dr.select(seen, of_densities * other_density / density * geometry, 0)

        # ---------------------- Connections to the phototransistor ----------------------
        bsdf = si.bsdf(mi.RayDifferential3f(ray))
        target, _ = sensor.sample_point(index, sampler.next_2d())
        of_base = _connection(base.scene, sensor, context, bsdf, si, target, clearance, active)
        of_other = _connection(other.scene, sensor, context, bsdf, at_next, target, clearance, active & (of_values > 0))
        change = throughput * (of_values * of_other - of_base) / (1 + of_densities)
        result += dr.select(active, change, 0)

        # ---------------------- Scattering ----------------------
        vertex, normal, moved, moved_normal, at_moved = si.p, si.n, at_next.p, at_next.n, at_next
        drawn, weight = bsdf.sample(context, si, sampler.next_1d(active), sampler.next_2d(active), active)
        direction, density, value = si.to_world(drawn.wo), mi.Float(drawn.pdf), weight[0] * drawn.pdf
        throughput *= weight[0]
        ray = leave(vertex, normal, direction, clearance)
        depth += 1
        active &= value > 0
        survival = dr.select(depth > LEAST_DEPTH, SURVIVAL, mi.Float(1))
        active &= sampler.next_1d(active) < survival
        throughput /= survival
    return result


def _connection(scene, sensor, context, bsdf, si, target, clearance, active) -> mi.Float:
    """Power that a connection from a vertex to a point of the phototransistor carries, per watt that arrives at the
    vertex.
    """
    wo = target - si.p
    squared = dr.squared_norm(wo)
    wo /= dr.sqrt(squared)
    cosine = -dr.dot(wo, sensor.normal)
    active = active & (cosine > 0)
    value = bsdf.eval(context, si, si.to_local(wo), active)[0]
    active &= value > 0
    active &= ~scene.ray_test(between(si.p, si.n, wo, clearance, target, sensor.normal), active)
    return dr.select(active, value * sensor.faces.area * cosine / squared * sensor.response(cosine), 0)
