"""Analog ray tracing, which counts rays: the method of the paper."""

from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.paths.ray_offsets import clearance_of, leave, release
from mitsuba_taxel.kernels.paths.wavefronts import splat
from mitsuba_taxel.sensing.reading import rendering
from mitsuba_taxel.specification.analog_tracer import AnalogTracer as Parameters
from mitsuba_taxel.specification.path_depth import MOST_REFLECTIONS


class AnalogTracer(mi.CppADIntegrator):
    r"""
    .. _integrator-analog_tracer:

    Analog tracer (:monosp:`analog_tracer`)
    ---------------------------------------

    This integrator releases rays of equal power from a grid of points in random directions. At each wall a ray is
    absorbed or reflected as a whole, at random. The reading is the power of the rays that reach the phototransistor.
    This is the method of the ray tracer in Multiphysics Simulation for the Optimization of an Optoelectronic-Based
    Tactile Sensor (section 2.1.3: 20 points with 3000 rays each).

    The integrator is meant for comparison: `taxel_tracer` needs thousands of times fewer rays. The grid is shifted
    randomly in each randomisation, so that the mean has no error from the grid. Directions are independent random
    numbers.

    .. tabs::
        .. code-tab:: xml

            <integrator type="analog_tracer"> <integer name="release_points" value="20"/> </integrator>

        .. code-tab:: python

            'type': 'analog_tracer', 'release_points': 20
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.specification = Parameters.read(props)
        self.release_points = self.specification.release_points

    render = rendering.render
    render_forward = render_backward = rendering.refuse_derivatives

    @dr.syntax
    def sample_paths(self, scene, pair, index, led_index, sampler, pixels):
        """Trace one random ray for each pair: from LED number ``led_index`` to phototransistor number ``index``.

        Returns the power in W that reaches the phototransistor.
        """
        led, sensor = pair.led, pair.sensor
        clearance = clearance_of(scene, pair)
        detector = mi.ShapePtr(sensor.get_shape())
        context = mi.BSDFContext(mi.TransportMode.Importance)
        # No width is given, which would add the number of the lane: a run can then be continued.
        random = mi.PCG32()
        random.seed(mi.sample_tea_32(sampler.sequence_seed, sampler.index)[0], sampler.index)

        # ---------------------- Release ----------------------
        vertex = mi.Point3f(led.sample_point(led_index, self._release_point(sampler)))
        normal = mi.Normal3f(led.faces.frame.n)
        direction = led.sample_direction_of_emission(mi.Point2f(random.next_float32(), random.next_float32()))
        vertex, passed = led.leave(led_index, vertex, direction)
        result = dr.zeros(mi.Float, dr.width(index))
        depth = mi.UInt32(0)
        active = mi.Bool(led.power > 0) | (index < 0)
        if dr.hint(pair.is_below_windows, mode="scalar"):
            active &= random.next_float32() < passed
        ray = release(vertex, normal, direction, clearance)
        while active:
            # ---------------------- Hit of the phototransistor ----------------------
            si = scene.ray_intersect(ray, active)
            active &= si.is_valid()
            inside, offset = sensor.contains(index, si.p, direction)
            cosine = -dr.dot(direction, sensor.normal)
            hits = active & (si.shape == detector) & inside & (cosine > 0)
            received = dr.select(hits, led.power * sensor.response(cosine), 0)
            splat(sensor, index, offset, received, pixels)
            result += received

            # ---------------------- Absorption or reflection ----------------------
            sample = mi.Point2f(random.next_float32(), random.next_float32())
            bs, weight = si.bsdf(ray).sample(context, si, random.next_float32(), sample, active)
            active &= random.next_float32() < weight[0]
            vertex, normal = mi.Point3f(si.p), mi.Normal3f(si.n)
            direction = si.to_world(bs.wo)
            ray = leave(vertex, normal, direction, clearance)
            depth += 1
            active &= depth < MOST_REFLECTIONS
        return result

    def _release_point(self, sampler) -> mi.Point2f:
        """A point of a Fibonacci grid on the unit square, shifted at random in each randomisation."""
        number = sampler.index % dr.opaque(mi.UInt32, self.release_points)
        shift = mi.sample_tea_32(sampler.sequence_seed, 0x5EED)
        u = (mi.Float(number) + 0.5) / dr.opaque(mi.Float, self.release_points) + mi.Float(shift[0]) * 2.0**-32
        v = mi.Float(number) * ((math.sqrt(5) - 1) / 2) + mi.Float(shift[1]) * 2.0**-32
        return mi.Point2f(u - dr.floor(u), v - dr.floor(v))

    def to_string(self) -> str:
        return f"AnalogTracer[release_points = {self.release_points}]"
