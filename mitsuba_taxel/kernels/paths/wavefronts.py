"""Wavefronts: paths of many readings and replicates that are traced together, with sums in a fixed order."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.kernels.taxel_pair import TaxelPair

LARGEST_WAVEFRONT = 1 << 22
"""Largest number of paths that are traced together."""


def trace(
    integrator: mi.Integrator,
    scene: mi.Scene,
    pair: TaxelPair,
    points: int,
    seed: int,
    replicates: int = 1,
    *,
    first: int = 0,
    image: bool = False,
    crosstalk: bool = False,
) -> tuple[np.ndarray, np.ndarray | None, int]:
    """Power on each phototransistor of a pair of LED and phototransistor arrays.

    Parameters
    ----------
    integrator : mi.Integrator
        Integrator whose ``sample_paths(scene, pair, index, led_index, sampler, pixels)`` returns the power of a path
        from each LED of ``led_index`` to the phototransistor of ``index``, and adds it to the map ``pixels``.
    scene : mi.Scene
        A loaded scene.
    pair : TaxelPair
        The arrays.
    points : int
        Paths for each reading and replicate; rounded up to a power of two.
    seed : int
        Seed of the random numbers.
    replicates : int
        Number of independent randomisations.
    first : int
        Number of the first point, 0 or a multiple of ``points``, to continue an earlier run.
    image : bool
        Whether to accumulate the irradiance map.
    crosstalk : bool
        Whether to read each LED on each phototransistor.

    Returns
    -------
    power : (replicates, readings) ndarray
        Power in W, one reading per taxel; with ``crosstalk``, (replicates, LEDs, phototransistors).
    image : (height, width) ndarray
        Irradiance in W/mm², or None.
    points : int
        Actual number of paths for each reading and replicate.
    """
    sampler = pair.sensor.sampler().fork()
    sampler.set_sample_count(points)
    points = sampler.sample_count()
    taxels = pair.count
    readings = taxels**2 if crosstalk else taxels
    film_size = pair.sensor.film().crop_size()
    # Sums over wavefronts are in double precision, within a wavefront in single precision.
    image_sums = np.zeros(film_size[0] * film_size[1])
    sums = np.empty(readings * replicates)
    sequences_at_once = max(1, LARGEST_WAVEFRONT // points)
    for start in range(0, len(sums), sequences_at_once):
        sequences = min(sequences_at_once, len(sums) - start)
        sampler.place(first, start)
        sampler.seed(seed, sequences * points)
        reading = sampler.sequence % dr.opaque(mi.UInt32, readings)
        index = reading % dr.opaque(mi.UInt32, taxels)
        led_index = reading // dr.opaque(mi.UInt32, taxels) if crosstalk else index
        pixels = dr.zeros(mi.Float, len(image_sums)) if image else None
        power = integrator.sample_paths(scene, pair, index, led_index, sampler, pixels)
        sums[start : start + sequences] = sum_blocks(power, points)
        if pixels is not None:
            image_sums += pixels.numpy()

    power = (sums / points).reshape(replicates, *((taxels, taxels) if crosstalk else (taxels,)))
    if not image:
        return power, None, points
    pixel_area = pair.sensor.faces.area * taxels / len(image_sums)
    irradiance = image_sums / (pixel_area * points * replicates)
    return power, irradiance.reshape(film_size[1], film_size[0]), points


def splat(sensor: mi.Sensor, index: mi.UInt32, offset: mi.Point2f, value: mi.Float, pixels: mi.Float | None) -> None:
    """Add the power of light paths to the irradiance map of the sensor, if it has one.

    Parameters
    ----------
    sensor : mi.Sensor
        A `phototransistor`, whose film has the size of the map.
    index : mi.UInt32
        Number of the phototransistor in the array.
    offset : mi.Point2f
        Position of the light relative to the centre of the phototransistor, mm.
    value : mi.Float
        Power, W.
    pixels : mi.Float or None
        The map, row by row; None without a map.
    """
    if pixels is not None:
        position = mi.Point2u(sensor.pixel(index, offset))
        dr.scatter_add(pixels, value, position.y * sensor.film().crop_size()[0] + position.x, value > 0)


def sum_blocks(values: mi.Float, count: int) -> np.ndarray:
    """Sums over consecutive blocks of ``count`` values, in double precision and in a fixed order.

    Partial sums in single precision have at most 256 values; their rounding error is far below a standard error.
    """
    block = 256 if count % 256 == 0 else 1
    partial = dr.block_sum(values, block) if block > 1 else values
    return partial.numpy().astype(np.float64).reshape(-1, count // block).sum(axis=1)
