"""Light traced from the LED of each taxel to the phototransistor of the same taxel."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.paths.emission_guiding import guided_emission
from mitsuba_taxel.kernels.paths.guide import guide_for
from mitsuba_taxel.kernels.paths.plane_mirrors import plane_mirrors
from mitsuba_taxel.kernels.paths.ray_offsets import clearance_of, leave, release
from mitsuba_taxel.kernels.paths.techniques import Mirrored, Techniques, Vertex
from mitsuba_taxel.kernels.paths.wavefronts import splat
from mitsuba_taxel.sensing.reading import rendering
from mitsuba_taxel.specification.path_depth import MOST_REFLECTIONS
from mitsuba_taxel.specification.taxel_tracer import TaxelTracer as Parameters


class TaxelTracer(mi.CppADIntegrator):
    r"""
    .. _integrator-taxel_tracer:

    Taxel tracer (:monosp:`taxel_tracer`)
    -------------------------------------

    Paths start at the LED: in this direction the weights of all walls are bounded. They contribute only to the
    phototransistor of the same taxel. `annular_led` and `phototransistor` are paired in the order of the scene.

    Three techniques are combined by multiple importance sampling with the power heuristic (E. Veach, 1997, chapters 9
    and 10): connections to the phototransistor, connections to the first point on a ray from the phototransistor, and
    unidirectional hits. Mirrors, diffuse walls and narrow gaps are therefore all efficient. Below a plane mirror as
    roof, walls that scatter are connected with the image of the phototransistor as well. Between the diffuse walls
    of a cell, path guiding samples directions towards other scattering walls. In scenes with mirrors, emission guiding
    learns from a pilot run the directions from which light returns.

    .. tabs::
        .. code-tab:: xml

            <integrator type="taxel_tracer"/>

        .. code-tab:: python

            'type': 'taxel_tracer'
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.specification = Parameters.read(props)
        self.max_depth = self.specification.max_depth
        self.rr_depth = self.specification.rr_depth
        self.strategy = self.specification.strategy

    render = rendering.render
    render_forward = render_backward = rendering.refuse_derivatives

    def sample_paths(self, scene, pair, index, led_index, sampler, pixels):
        """Power [W] from each LED of ``led_index`` to the phototransistor of ``index``, estimated by a path each."""
        emission, guide = guided_emission(self, scene, pair), guide_for(scene, pair)
        mirrors = plane_mirrors(scene, pair)

        def trace(scene, sampler, index, led_index):
            return self.sample_guided(scene, pair, index, led_index, sampler, pixels, emission, guide, mirrors)

        if pixels is not None:
            return trace(scene, sampler, index, led_index)
        return pair.sensor.recorded.power(trace, scene, sampler, index, led_index, self, emission, guide, mirrors)

    @dr.syntax
    def sample_guided(self, scene, pair, index, led_index, sampler, pixels, emission, guide, mirrors):
        """Power [W] as in :meth:`sample_paths`, with guided directions.

        Parameters
        ----------
        scene, pair, index, led_index, sampler, pixels
            See :meth:`sample_paths`.
        emission : GuidedEmission or None
            Distribution of the directions of emission; None for the law of the LED.
        guide : Guide or None
            Distribution of the directions between diffuse walls; None for those of the BSDFs alone.
        mirrors : PlaneMirrors or None
            Plane mirrors over which walls are connected with the phototransistor; None without them.
        """
        led, sensor = pair.led, pair.sensor
        clearance = clearance_of(scene, pair)
        techniques = Techniques(self.strategy, scene, sensor, index, guide, clearance, mirrors)
        most_reflections = dr.opaque(mi.UInt32, MOST_REFLECTIONS if self.max_depth < 0 else self.max_depth)
        is_bent = pair.is_below_windows

        # ---------------------- Emission ----------------------
        result = dr.zeros(mi.Float, dr.width(index))
        power = mi.Float(led.power) + result
        source = led.sample_point(led_index, sampler.next_2d())
        sample, overdrawn = sampler.next_2d(), mi.Float(1)
        if dr.hint(emission is not None, mode="scalar"):
            sample, overdrawn = emission.sample(led_index, sample)
        direction = led.sample_direction_of_emission(sample)
        view = techniques.look(sampler.next_2d(), sampler.next_2d())
        at = mi.Point3f(source), mi.Normal3f(led.faces.frame.n)
        vertex = Vertex(*at, power, mi.Float(0), mi.Point2f(0), mi.Float(0), mi.Float(0))
        emit = partial(_emit, led)
        sight = led.window.sight(led_index, mi.Point3f(view.si.p), source)
        value = techniques.connect_subpath(view, vertex, emit, (power > 0) & (most_reflections > 0), sight)
        if dr.hint(techniques.follows_mirrors, mode="scalar"):
            reflected = techniques.reflect(view, sampler.next_1d())
            sight = led.window.sight(led_index, mi.Point3f(reflected.si.p), source)
            seen = (power > 0) & (reflected.mirrors < most_reflections)
            value += techniques.connect_subpath(reflected, vertex, emit, seen, sight)
        if dr.hint(not pair.coplanar, mode="scalar"):
            value += techniques.connect(view, vertex, emit, power > 0)
        splat(sensor, index, view.offset, value, pixels)
        result += value

        # The current ray: its density, and its throughput before division by that density. Weights assume that rays of
        # the LED are sampled from its law alone: any densities are valid in weights if all techniques use the same.
        density = led.density_of_direction(direction)
        vertex.p, passed = led.leave(led_index, vertex.p, direction)
        power = power * passed
        carried = power * density / overdrawn
        ray = release(vertex.p, vertex.n, direction, clearance)
        specular = mi.Bool(False)
        mirrored = Mirrored.nowhere()
        reach = mi.Float(dr.inf)  # distance of the point sampled by the guide; infinite without such a point
        target = mi.UInt32(0)  # triangle of that point
        depth = mi.UInt32(0)
        active = carried > 0
        while active:
            # ---------------------- Next vertex ----------------------
            si = scene.ray_intersect(ray, active)
            active &= si.is_valid()
            distance = dr.norm(si.p - vertex.p)
            if dr.hint(is_bent, mode="scalar"):
                apparent = led.window.apparent(dr.square(distance), dr.dot(direction, led.faces.frame.n))
                distance = dr.select(depth == 0, dr.sqrt(apparent), distance)
            member, guided, surface_uv = techniques.guidance(si, active)
            # A point sampled by the guide counts only if it is visible; rounding may hit the adjacent triangle.
            reaches_target = (si.prim_index == target) | (dr.abs(distance - reach) <= 1e-3 * reach)
            active &= (reach == dr.inf) | (reaches_target & member)
            cosine = dr.abs(dr.dot(si.n, direction))
            total_density = techniques.drawn(density, vertex, member, surface_uv, dr.square(distance) / cosine)
            throughput = carried / dr.select(specular, density, total_density)

            # ---------------------- Unidirectional hit ----------------------
            previous = replace(vertex, throughput=throughput)
            value, offset = techniques.hit(si, direction, previous, total_density, specular, mirrored)
            value = dr.select(active, value, 0)
            splat(sensor, index, offset, value, pixels)
            result += value

            # ---------------------- Connections ----------------------
            active &= depth < most_reflections
            inverse = dr.select(specular, 0, dr.square(distance) / (total_density * cosine))
            bsdf = si.bsdf(ray)
            ends_views = techniques.ends_views(si, bsdf, active)
            vertex = Vertex(si.p, si.n, throughput, guided, surface_uv, inverse, ends_views)
            scatter = partial(_scatter, techniques.context, si, bsdf, active)
            value = techniques.connect(view, vertex, scatter, active)
            value += techniques.connect_subpath(view, vertex, scatter, active & (depth + 1 < most_reflections))
            value += techniques.connect_image(view, vertex, scatter, active & (depth + 1 < most_reflections))
            if dr.hint(techniques.follows_mirrors, mode="scalar"):
                seen = active & (depth + 1 + reflected.mirrors < most_reflections)
                value += techniques.connect_subpath(reflected, vertex, scatter, seen)
            splat(sensor, index, view.offset, value, pixels)
            result += value

            # ---------------------- BSDF sampling and path guiding ----------------------
            choice, sample = sampler.next_1d(active), sampler.next_2d(active)
            by_guide = choice < vertex.guided
            nearness = choice / vertex.guided
            choice = (choice - vertex.guided) / (1 - vertex.guided)
            bs, weight = bsdf.sample(techniques.context, si, choice, sample, active & ~by_guide)
            arrival, direction = mi.Vector3f(direction), si.to_world(bs.wo)
            density = mi.Float(bs.pdf)
            carried = throughput * weight[0] * density
            arrived_specular = mi.Bool(specular)
            specular = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            reach = mi.Float(dr.inf)
            if dr.hint(techniques.guide is not None, mode="scalar"):
                point, target = techniques.draw(vertex, sample, nearness)
                to_target = point - vertex.p
                target_distance = dr.norm(to_target)
                towards = to_target / target_distance
                value, target_density = scatter(towards)
                direction = dr.select(by_guide, towards, direction)
                density = dr.select(by_guide, target_density, density)
                carried = dr.select(by_guide, throughput * value, carried)
                specular &= ~by_guide
                reach = dr.select(by_guide, target_distance, reach)
            if dr.hint(techniques.follows_mirrors or techniques.mirrors is not None, mode="scalar"):
                # The LED is not connected over mirrors: emission guiding finds them.
                mirrored = techniques.mirrored(
                    si,
                    active & specular & (depth > 0),
                    mirrored,
                    arrived_specular,
                    previous,
                    arrival,
                    total_density,
                    density,
                    direction,
                    distance,
                )
            ray = leave(vertex.p, vertex.n, direction, clearance)
            if dr.hint(techniques.guide is not None, mode="scalar"):
                # From the offset origin to the exact point: otherwise a grazing ray would hit the adjacent triangle.
                ray = mi.Ray3f(ray.o, dr.select(by_guide, dr.normalize(point - ray.o), ray.d))
            # ---------------------- Russian roulette ----------------------
            depth += 1
            active &= carried > 0
            survival = dr.select(depth > self.rr_depth, dr.minimum(throughput / power, 1), 1)
            active &= sampler.next_1d(active) < survival
            carried /= survival
        return result

    def to_string(self) -> str:
        return f"TaxelTracer[max_depth = {self.max_depth}, strategy = {self.strategy}]"


def _emit(led, wo: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """Fraction of an LED's power that leaves per solid angle, and the density of its rays."""
    return led.emitted_fraction(wo), led.density_of_direction(wo)


def _scatter(context, si, bsdf, active, wo: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """Fraction of the light that a wall scatters per solid angle, and the density of its rays."""
    value, density = bsdf.eval_pdf(context, si, si.to_local(wo), active)
    return value[0], density
