"""Wavefronts: paths of many readings and replicates traced at once, with sums in a fixed order."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.kernels.taxel_pair import TaxelPair

LARGEST_WAVEFRONT = 1 << 22
"""Largest number of paths traced at once."""


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
        Its ``sample_paths(scene, pair, index, led_index, sampler, pixels)`` returns the power that one path from each
        LED of ``led_index`` brings to the phototransistor of ``index``, and adds it to the map ``pixels``.
    scene : mi.Scene
        A loaded one.
    pair : TaxelPair
        The arrays.
    points : int
        Paths for each reading and replicate; rounded up to a power of two.
    seed : int
        Of the random numbers.
    replicates : int
        Independent randomisations.
    first : int
        Number of the first of them, 0 or a multiple of ``points``, to continue an earlier run.
    image : bool
        Whether to accumulate the irradiance map.
    crosstalk : bool
        Whether to read each LED on each phototransistor.

    Returns
    -------
    power : (replicates, readings) ndarray
        In W, one reading per taxel; with ``crosstalk``, (replicates, LEDs, phototransistors).
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
    collected = np.zeros(film_size[0] * film_size[1])  # double precision over wavefronts in single
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


def splat(sensor: mi.Sensor, index: mi.UInt32, offset: mi.Point2f, value: mi.Float, pixels: mi.Float | None) -> None:
    """Add light to the irradiance map, if there is one.

    Parameters
    ----------
    sensor : mi.Sensor
        A `phototransistor`, whose film has the size of the map.
    index : mi.UInt32
        Of the phototransistor in the array.
    offset : mi.Point2f
        Where the light meets it, from its centre, mm.
    value : mi.Float
        Power, W.
    pixels : mi.Float or None
        The map, row by row; None without one.
    """
    if pixels is not None:
        position = mi.Point2u(sensor.pixel(index, offset))
        dr.scatter_add(pixels, value, position.y * sensor.film().crop_size()[0] + position.x, value > 0)


def sum_blocks(values: mi.Float, count: int) -> np.ndarray:
    """Sums over consecutive blocks of ``count`` values, in double precision and in a fixed order.

    Single-precision partial sums have at most 256 values; their rounding is far below a standard error.
    """
    block = 256 if count % 256 == 0 else 1
    partial = dr.block_sum(values, block) if block > 1 else values
    return partial.numpy().astype(np.float64).reshape(-1, count // block).sum(axis=1)
