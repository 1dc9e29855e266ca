"""Light traced backwards from the phototransistor of each taxel to the LED of the same taxel."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.paths.ray_offsets import between, clearance_of, leave, release
from mitsuba_taxel.kernels.paths.wavefronts import splat
from mitsuba_taxel.kernels.taxels.emission import UniformPolarAngle
from mitsuba_taxel.kernels.walls import is_bounded_from_detector, walls_of
from mitsuba_taxel.sensing.reading import rendering
from mitsuba_taxel.specification.path_depth import MOST_REFLECTIONS
from mitsuba_taxel.specification.taxel_path import TaxelPath as Parameters


class TaxelPath(mi.CppADIntegrator):
    r"""
    .. _integrator-taxel_path:

    Taxel path tracer (:monosp:`taxel_path`)
    ----------------------------------------

    Paths start at the phototransistor. Each reflection is connected to a point of the LED, and paths that hit the LED
    count as well; both techniques are combined by the power heuristic. The expected reading is that of `taxel_tracer`.
    The cost is lower than that of `taxel_tracer` only for a broad LED and a phototransistor of narrow angular response
    under a diffuse plate.

    Scenes in which weights would be unbounded are refused: those with isotropic walls, which are not reciprocal, and
    those with the law :monosp:`uniform_polar_angle`, whose intensity is unbounded on the axis.

    .. tabs::
        .. code-tab:: xml

            <integrator type="taxel_path"/>

        .. code-tab:: python

            'type': 'taxel_path'
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.specification = Parameters.read(props)
        self.max_depth = self.specification.max_depth
        self.rr_depth = self.specification.rr_depth

    def refuse_unbounded(self, scene) -> None:
        """Raise `InputError` if weights of paths from the phototransistors of a scene would be unbounded."""
        if not all(map(is_bounded_from_detector, walls_of(scene))):
            raise InputError(
                "taxel_path: isotropic walls are not allowed, as weights of paths from the detector are unbounded: use "
                "taxel_tracer.",
                self,
            )
        if any(isinstance(led.law, UniformPolarAngle) for led in scene.emitters()):
            raise InputError(
                "taxel_path: law = 'uniform_polar_angle' is not allowed, as its intensity is unbounded on the axis: "
                "use taxel_tracer.",
                self,
            )

    render = rendering.render
    render_forward = render_backward = rendering.refuse_derivatives

    @dr.syntax
    def sample_paths(self, scene, pair, index, led_index, sampler, pixels):
        """Power [W] from the LED of ``led_index`` to each phototransistor of ``index``, estimated by a path each."""
        led, sensor = pair.led, pair.sensor
        clearance = clearance_of(scene, pair)
        carrier = mi.ShapePtr(led.get_shape())
        context = mi.BSDFContext(mi.TransportMode.Radiance)
        most_reflections = dr.opaque(mi.UInt32, MOST_REFLECTIONS if self.max_depth < 0 else self.max_depth)

        # ---------------------- Point and direction on the phototransistor ----------------------
        y, offset = sensor.sample_point(index, sampler.next_2d())
        local, density = sensor.sample_view(sampler.next_2d())
        direction = sensor.faces.frame.to_world(local)
        target = mi.Point3f(led.sample_point(led_index, sampler.next_2d()))
        exit_point, is_open = sensor.window.leave(index, y, direction)
        vertex, normal = mi.Point3f(exit_point), mi.Normal3f(sensor.normal)
        result = dr.zeros(mi.Float, dr.width(index))
        if dr.hint(not pair.coplanar, mode="scalar"):
            result += self._straight_across(scene, pair, vertex, target, clearance)

        throughput = sensor.faces.area * sensor.response(local.z) * local.z / density + result * 0
        full = mi.Float(throughput)
        specular = mi.Bool(False)
        depth = mi.UInt32(0)
        active = (density > 0) & (throughput > 0) & (local.z > 0) & is_open
        ray = release(vertex, normal, direction, clearance)
        while active:
            si = scene.ray_intersect(ray, active)
            active &= si.is_valid()

            # ---------------------- Hit of the LED ----------------------
            # Direct light (depth 0) is estimated by the connection alone.
            cosine = -dr.dot(direction, led.faces.frame.n)
            inside = led.contains(led_index, si.p, direction)
            hits = active & (depth > 0) & (si.shape == carrier) & inside & (cosine > 0)
            distance_squared = led.window.apparent(dr.squared_norm(si.p - vertex), cosine)
            connection = distance_squared / (density * cosine * led.area)
            weight = dr.select(specular, 1, dr.rcp(1 + dr.square(connection)))
            radiance = led.power * led.emitted_fraction(-direction) / (led.area * cosine)
            result += dr.select(hits, throughput * radiance * weight, 0)

            active &= depth < most_reflections
            vertex, normal = mi.Point3f(si.p), mi.Normal3f(si.n)
            bsdf = si.bsdf(ray)

            # ---------------------- Connection to a point of the LED ----------------------
            sight = led.window.sight(led_index, vertex, target)
            wo, distance_squared = sight.direction, sight.squared_distance
            cosine = -dr.dot(wo, led.faces.frame.n)
            intensity = led.power * led.emitted_fraction(-wo)
            value, bsdf_density = bsdf.eval_pdf(context, si, si.to_local(wo), active)
            visible = active & (cosine > 0) & (intensity > 0) & (value[0] > 0) & sight.is_open
            visible &= ~scene.ray_test(
                between(vertex, normal, wo, clearance, sight.crossing, led.faces.frame.n), visible
            )
            hit = bsdf_density * led.area * cosine / distance_squared
            value = throughput * value[0] * intensity / (distance_squared * (1 + dr.square(hit)))
            result += dr.select(visible, value, 0)

            # ---------------------- BSDF sampling ----------------------
            bs, weight = bsdf.sample(context, si, sampler.next_1d(active), sampler.next_2d(active), active)
            direction = si.to_world(bs.wo)
            density = mi.Float(bs.pdf)
            specular = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            throughput *= weight[0]
            ray = leave(vertex, normal, direction, clearance)
            # ---------------------- Russian roulette ----------------------
            depth += 1
            active &= throughput > 0
            survival = dr.select(depth > self.rr_depth, dr.minimum(throughput / full, 1), 1)
            active &= sampler.next_1d(active) < survival
            throughput /= survival
        splat(sensor, index, offset, result, pixels)
        return result

    @staticmethod
    def _straight_across(scene, pair, y, target, clearance):
        """Power [W] that reaches the phototransistor from the LED without reflection, by the direct connection of two
        points."""
        led, sensor = pair.led, pair.sensor
        to_target = target - y
        distance_squared = dr.squared_norm(to_target)
        wo = to_target * dr.rsqrt(distance_squared)
        cosine = dr.dot(wo, sensor.normal)
        visible = (cosine > 0) & (dr.dot(wo, led.faces.frame.n) < 0)
        visible &= ~scene.ray_test(between(y, sensor.normal, wo, clearance, target, led.faces.frame.n), visible)
        value = led.power * led.density_of_direction(-wo) * sensor.faces.area * cosine / distance_squared
        return dr.select(visible, value * sensor.response(cosine), 0)

    def to_string(self) -> str:
        return f"TaxelPath[max_depth = {self.max_depth}]"
