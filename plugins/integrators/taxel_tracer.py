"""Light traced from each taxel's LED to its own phototransistor."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.parameters import choice, whole_number
from mitsuba_taxel.optics.taxels import taxels_of

STRATEGIES = ("both", "connections", "hits")
_LARGEST_WAVEFRONT = 1 << 22
_MOST_REFLECTIONS = 1 << 17


class TaxelTracer(mi.CppADIntegrator):
    r"""
    .. _integrator-taxel_tracer:

    Taxel tracer (:monosp:`taxel_tracer`)
    -------------------------------------

    .. pluginparameters::

     * - max_depth
       - |int|
       - Most reflections on a path; -1 for no limit but the 131072 after which a path that nothing absorbs is left.
         (Default: -1)

     * - rr_depth
       - |int|
       - Reflections after which paths of little weight may end by Russian roulette. (Default: 8)

     * - strategy
       - |string|
       - :monosp:`both`, or one of its two parts alone, to check them: :monosp:`connections` (each reflection is
         connected to a point of the phototransistor) or :monosp:`hits` (paths that happen to arrive there).
         (Default: :monosp:`both`)

    Paths start at the LED, where the weights of all walls are bounded, and are read by the phototransistor of the
    same taxel only, so that no work goes into LEDs that a phototransistor is not read against. Connections and hits
    are combined by multiple importance sampling with the power heuristic (E. Veach, 1997, section 9.2), which
    makes both mirrors and diffuse walls right. `annular_led` and `phototransistor` pair up in the order in which
    the scene lists them.

    .. tabs::
        .. code-tab:: xml

            <integrator type="taxel_tracer"/>

        .. code-tab:: python

            'type': 'taxel_tracer'
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.max_depth = whole_number(props, "max_depth", -1, minimum=-1, maximum=_MOST_REFLECTIONS)
        self.rr_depth = whole_number(props, "rr_depth", 8, minimum=0, maximum=1 << 20)
        self.strategy = choice(props, "strategy", "both", STRATEGIES)

    def render(self, scene, sensor=0, seed=0, spp=0, develop=True, evaluate=True):
        """Irradiance map [W/mm²] of one sensor's phototransistors, as a tensor (height, width, channels)."""
        sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
        film = sensor.film()
        pair = next((pair for pair in taxels_of(scene) if pair.sensor is sensor), None)
        if pair is None:
            raise InputError("taxel_tracer: the sensor to render is not a phototransistor.")
        count = spp or sensor.sampler().sample_count()
        _, image, _ = self.trace(scene, pair, count, seed, image=True)
        film.prepare([])
        block = film.create_block()
        height, width = image.shape
        pixel = dr.arange(mi.UInt32, height * width)
        centre = mi.Point2f(mi.Float(pixel % width), mi.Float(pixel // width)) + 0.5
        block.put(centre, dr.zeros(mi.Color0f), mi.Spectrum(mi.Float(image.ravel())), 1.0, 1.0)
        film.put_block(block)
        result = film.develop() if develop else None
        if evaluate:
            dr.eval(result)
        return result

    def trace(self, scene, pair, points: int, seed: int, replicates: int = 1, image: bool = False):
        """Power on each phototransistor of a pair of LED and phototransistor arrays.

        Parameters
        ----------
        pair : a :class:`mitsuba_taxel.optics.taxels.TaxelPair`
        points : paths for each taxel and replicate (a sampler may round it up)
        replicates : independent randomisations
        image : whether to accumulate the irradiance map as well

        Returns
        -------
        power : (replicates, taxels) float64 array, W
        image : (height, width) irradiance in W/mm², or None
        points : paths for each taxel and replicate, as the sampler has it
        """
        sampler = pair.sensor.sampler().fork()
        sampler.set_sample_count(points)
        points = sampler.sample_count()
        taxels = pair.sensor.faces.count
        film_size = pair.sensor.film().crop_size()
        pixels = dr.zeros(mi.Float, film_size[0] * film_size[1]) if image else None
        share = max(1, _LARGEST_WAVEFRONT // points)
        sums = np.empty(taxels * replicates)
        for start in range(0, taxels * replicates, share):
            sequences = min(share, taxels * replicates - start)
            sampler.set_samples_per_wavefront(points)
            sampler.seed(mi.sample_tea_32(seed, start)[0] if start else seed, sequences * points)
            lane = dr.arange(mi.UInt32, sequences * points)
            sequence = lane // dr.opaque(mi.UInt32, points) + dr.opaque(mi.UInt32, start)
            index = sequence % dr.opaque(mi.UInt32, taxels)
            power = self._trace_paths(scene, pair, index, sampler, pixels)
            sums[start : start + sequences] = _sum_blocks(power, points)
        power = (sums / points).reshape(replicates, taxels)
        if pixels is None:
            return power, None, points
        pixel_area = pair.sensor.faces.area * taxels / (film_size[0] * film_size[1])
        irradiance = (pixels / (pixel_area * points * replicates)).numpy()
        return power, irradiance.reshape(film_size[1], film_size[0]), points

    @dr.syntax
    def _trace_paths(self, scene, pair, index, sampler, pixels):
        """Power that one path from each LED of ``index`` brings to its phototransistor [W]."""
        led, sensor = pair.led, pair.sensor
        connections = self.strategy != "hits"
        hits = self.strategy != "connections"
        detector = mi.ShapePtr(sensor.get_shape())
        context = mi.BSDFContext(mi.TransportMode.Importance)

        source = led.sample_point(index, sampler.next_2d())
        direction = led.sample_direction_of_emission(sampler.next_2d())
        ray = _leave(source, led.faces.frame.n, direction)

        throughput = mi.Float(led.power) + dr.zeros(mi.Float, dr.width(index))
        result = dr.zeros(mi.Float, dr.width(index))
        density = led.density_of_direction(direction)
        depth = mi.UInt32(0)
        most_reflections = dr.opaque(mi.UInt32, _MOST_REFLECTIONS if self.max_depth < 0 else self.max_depth)
        vertex = mi.Point3f(source)
        active = throughput > 0

        if not pair.coplanar and connections:
            target, offset, geometry, wo, visible = self._connect(sensor, index, source, sampler)
            emitted = led.density_of_direction(wo)
            visible &= emitted > 0
            visible &= ~scene.ray_test(_leave(source, led.faces.frame.n, wo, target), visible)
            weight = _power_heuristic(dr.rcp(geometry), emitted) if hits else 1
            value = dr.select(visible, led.power * emitted * geometry * weight, 0)
            result += value
            self._splat(sensor, index, offset, value, pixels)

        while active:
            si = scene.ray_intersect(ray, active)
            active &= si.is_valid()

            if hits:
                inside, offset = sensor.contains(index, si.p)
                cosine = -dr.dot(ray.d, sensor.normal)
                here = active & (si.shape == detector) & inside & (cosine > 0)
                weight = mi.Float(1)
                if connections:
                    connection_density = dr.squared_norm(si.p - vertex) / (cosine * sensor.faces.area)
                    weight = dr.select(density > 0, _power_heuristic(density, connection_density), 1)
                value = dr.select(here, throughput * weight, 0)
                result += value
                self._splat(sensor, index, offset, value, pixels)

            active &= depth < most_reflections
            bsdf = si.bsdf(ray)
            if connections:
                target, offset, geometry, wo, visible = self._connect(sensor, index, si.p, sampler)
                value, bsdf_density = bsdf.eval_pdf(context, si, si.to_local(wo), visible & active)
                value = value[0]
                visible &= active & (value > 0)
                visible &= ~scene.ray_test(_leave(si.p, si.n, wo, target), visible)
                weight = _power_heuristic(dr.rcp(geometry), bsdf_density) if hits else mi.Float(1)
                value = dr.select(visible, throughput * value * geometry * weight, 0)
                result += value
                self._splat(sensor, index, offset, value, pixels)

            bs, bsdf_weight = bsdf.sample(context, si, sampler.next_1d(active), sampler.next_2d(active), active)
            throughput *= bsdf_weight[0]
            density = dr.select(mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta), 0, bs.pdf)
            vertex = mi.Point3f(si.p)
            ray = _leave(si.p, si.n, si.to_world(bs.wo))
            depth += 1
            active &= throughput > 0
            survival = dr.select(depth > self.rr_depth, dr.minimum(throughput / led.power, 1), 1)
            active &= sampler.next_1d(active) < survival
            throughput /= survival
        return result

    @staticmethod
    def _connect(sensor, index, p, sampler):
        """A point on the phototransistor: point, offset, solid angle of the whole area under it, direction, facing."""
        target, offset = sensor.sample_point(index, sampler.next_2d())
        d = target - p
        distance_squared = dr.squared_norm(d)
        wo = d * dr.rsqrt(distance_squared)
        cosine = -dr.dot(wo, sensor.normal)
        facing = (cosine > 0) & (distance_squared > 0)
        geometry = dr.select(facing, sensor.faces.area * cosine / distance_squared, 0)
        return target, offset, geometry, wo, facing

    @staticmethod
    def _splat(sensor, index, offset, value, pixels) -> None:
        if pixels is not None:
            position = mi.Point2u(sensor.pixel(index, offset))
            dr.scatter_add(pixels, value, position.y * sensor.film().crop_size()[0] + position.x, value > 0)

    def to_string(self) -> str:
        return f"TaxelTracer[max_depth = {self.max_depth}, strategy = {self.strategy}]"


def _leave(p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, target: mi.Point3f | None = None) -> mi.Ray3f:
    """A ray from a point of a surface in direction ``d``, clear of that surface, up to ``target`` if one is given.

    Mitsuba moves the origin along the normal, by 9e-5 (1 + max|p|), and so shifts the ray: a plate at 0.1 mm then
    reads half a percent too much. Here the origin moves along the ray itself, except at grazing angles.
    """
    cosine = dr.dot(n, d)
    offset = 9e-5 * (1 + dr.max(dr.abs(p)))
    along = dr.minimum(offset / dr.abs(cosine), 20 * offset)
    aside = dr.maximum(offset - along * dr.abs(cosine), 0)
    origin = p + d * along + n * dr.mulsign(aside, cosine)
    if target is None:
        return mi.Ray3f(origin, d)
    rest = target - origin
    distance = dr.norm(rest)
    return mi.Ray3f(origin, rest / distance, distance * (1 - 1e-3), 0.0, dr.zeros(mi.Color0f))


def _power_heuristic(mine: mi.Float, other: mi.Float) -> mi.Float:
    """Weight of a sample drawn with density ``mine`` where the other technique has density ``other``."""
    ratio = other / mine
    return dr.rcp(1 + dr.square(ratio))


def _sum_blocks(values: mi.Float, count: int) -> np.ndarray:
    """Sums over consecutive runs of ``count`` values, in double precision and in an order that never varies.

    Single-precision sums go over 256 values at most; what they lose is far below a standard error.
    """
    block = 256 if count % 256 == 0 else 1
    partial = dr.block_sum(values, block) if block > 1 else values
    return partial.numpy().astype(np.float64).reshape(-1, count // block).sum(axis=1)
