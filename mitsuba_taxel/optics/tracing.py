"""What the integrators share: rays that leave a surface, batches of replicates, sums whose order never varies."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.modelled import refuse_unmodelled
from mitsuba_taxel.optics.taxels import TaxelPair, taxels_of

LARGEST_WAVEFRONT = 1 << 22
"""Paths that are traced at once."""
MOST_REFLECTIONS = 1 << 17
"""Reflections after which a path that nothing absorbs is left."""


def leave(p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float) -> mi.Ray3f:
    """A ray from a point of a surface in direction ``d``, clear of that surface.

    Mitsuba moves the origin by 9e-5 (1 + max|p|): a plate at 0.1 mm then reads half a percent too much, and a scene in
    metres is wrong altogether. Here it moves by no more than single precision asks for: ``clearance`` (see
    :func:`clearance_of`) and 1e-6 of the distance from the scene's origin. It moves along the normal, since a step
    along the ray may lead through the wall next to an edge.
    """
    return mi.Ray3f(_cleared(p, n, d, clearance), d)


def between(
    p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float, target: mi.Point3f, target_n: mi.Vector3f
) -> mi.Ray3f:
    """As :func:`leave`, up to a point of another surface with normal ``target_n``, and clear of that as well."""
    origin = _cleared(p, n, d, clearance)
    rest = _cleared(target, target_n, -d, clearance) - origin
    distance = dr.norm(rest)
    return mi.Ray3f(origin, rest / distance, distance * (1 - 1e-3), 0.0, dr.zeros(mi.Color0f))


def release(p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float) -> mi.Ray3f:
    """As :func:`leave` for a ray from a flat face with no wall beside it: it keeps to its line, and so has no bias."""
    offset = _offset(p, clearance)
    return mi.Ray3f(p + d * dr.minimum(offset / dr.abs(dr.dot(n, d)), 20 * offset), d)


def _cleared(p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float) -> mi.Point3f:
    """A point of a surface, moved off it to the side that ``d`` leads to."""
    return p + n * dr.mulsign(_offset(p, clearance), dr.dot(n, d))


def _offset(p: mi.Point3f, clearance: mi.Float) -> mi.Float:
    return dr.fma(1e-6, dr.max(dr.abs(p)), clearance)


def clearance_of(pair: TaxelPair) -> mi.Float:
    """The part of a ray's offset that goes with the size of the parts, whatever the scene's unit of length."""
    return 2e-6 * dr.sqrt(pair.sensor.faces.area)


def trace(
    integrator: Any,
    scene: mi.Scene,
    pair: TaxelPair,
    points: int,
    seed: int,
    replicates: int = 1,
    *,
    first: int = 0,
    image: bool = False,
    crosstalk: bool = False,
):
    """Power on each phototransistor of a pair of LED and phototransistor arrays.

    Parameters
    ----------
    integrator : has ``sample_paths(scene, pair, index, led_index, sampler, pixels)``, the power that one path from
        each LED of ``led_index`` brings to the phototransistor of ``index``, and adds it to the map ``pixels``
    points : paths for each reading and replicate; rounded up to a power of two
    first : number of the first of them, 0 or a multiple of ``points``: a later run goes on where one has stopped
    replicates : independent randomisations
    image : whether to accumulate the irradiance map as well
    crosstalk : whether each LED is to be read on each phototransistor

    Returns
    -------
    power : (replicates, readings) float64 array, W: one reading for each taxel, or, with ``crosstalk``, for each LED
        and phototransistor, (replicates, LEDs, phototransistors)
    image : (height, width) irradiance in W/mm², or None
    points : paths for each reading and replicate, as the sampler has it
    """
    sampler = pair.sensor.sampler().fork()
    sampler.set_sample_count(points)
    points = sampler.sample_count()
    taxels = pair.count
    readings = taxels**2 if crosstalk else taxels
    film_size = pair.sensor.film().crop_size()
    collected = np.zeros(film_size[0] * film_size[1])  # in double precision, over wavefronts in single
    sums = np.empty(readings * replicates)
    share = max(1, LARGEST_WAVEFRONT // points)
    for start in range(0, len(sums), share):
        sequences = min(share, len(sums) - start)
        sampler.place(first, start)
        sampler.seed(seed, sequences * points)
        reading = sampler.sequence % dr.opaque(mi.UInt32, readings)
        index = reading % dr.opaque(mi.UInt32, taxels)
        led_index = reading // dr.opaque(mi.UInt32, taxels) if crosstalk else index
        pixels = dr.zeros(mi.Float, len(collected)) if image else None
        power = integrator.sample_paths(scene, pair, index, led_index, sampler, pixels)
        sums[start : start + sequences] = sum_blocks(power, points)
        if pixels is not None:
            collected += pixels.numpy()
    power = (sums / points).reshape(replicates, *((taxels, taxels) if crosstalk else (taxels,)))
    if not image:
        return power, None, points
    pixel_area = pair.sensor.faces.area * taxels / len(collected)
    irradiance = collected / (pixel_area * points * replicates)
    return power, irradiance.reshape(film_size[1], film_size[0]), points


def render(integrator: Any, scene: mi.Scene, sensor: Any, seed: int, spp: int, develop: bool, evaluate: bool):
    """What `mi.render` asks of an integrator: the irradiance map [W/mm²] of one sensor, (height, width, channels)."""
    sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
    film = sensor.film()
    refuse_unmodelled(scene, integrator)
    pair = next((pair for pair in taxels_of(scene) if pair.sensor is sensor), None)
    if pair is None:
        raise InputError("the sensor to render is not a phototransistor.")
    _, image, _ = trace(integrator, scene, pair, spp or sensor.sampler().sample_count(), int(seed), image=True)
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


def refuse_derivatives(integrator: Any, *_: Any, **__: Any) -> None:
    """What `dr.forward` and `dr.backward` come to through the image of one of our integrators; raises `InputError`."""
    raise InputError(
        f"derivatives by dr.forward or dr.backward are not available through {integrator!s}: take differences of "
        "readings of the same seed, which share their random numbers."
    )


def splat(sensor: Any, index: mi.UInt32, offset: mi.Point2f, value: mi.Float, pixels: mi.Float | None) -> None:
    """Add ``value`` to the pixel of phototransistor ``index`` at ``offset`` from its centre, if there is a map."""
    if pixels is not None:
        position = mi.Point2u(sensor.pixel(index, offset))
        dr.scatter_add(pixels, value, position.y * sensor.film().crop_size()[0] + position.x, value > 0)


def sum_blocks(values: mi.Float, count: int) -> np.ndarray:
    """Sums over consecutive runs of ``count`` values, in double precision and in an order that never varies.

    Single-precision sums go over 256 values at most; what they lose is far below a standard error.
    """
    block = 256 if count % 256 == 0 else 1
    partial = dr.block_sum(values, block) if block > 1 else values
    return partial.numpy().astype(np.float64).reshape(-1, count // block).sum(axis=1)
