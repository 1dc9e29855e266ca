"""Readings by raysect: light paths from the phototransistor, with importance sampling of the LED, on all cores."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.evidence.peers.cases import DETECTOR, LED_SIDE, Estimator, PeerCase

IMPORTANT = 0.8
"""Fraction of the directions from the plate that are sampled towards the LED."""


def prepare(case: PeerCase) -> Estimator:
    """Return a function that estimates readings. The plate is a Lambertian mesh, the LED an emitting mesh, and the
    phototransistor a pixel directed at the plate."""
    z, spacing = case.plate()
    from raysect.core import translate
    from raysect.core.math.random import seed as set_seed
    from raysect.optical import ConstantSF, World
    from raysect.optical.material import Lambert, UniformSurfaceEmitter
    from raysect.optical.observer import PowerPipeline0D, TargetedPixel
    from raysect.primitive import Mesh

    world = World()
    led = UniformSurfaceEmitter(ConstantSF(1 / (np.pi * LED_SIDE**2)))
    led.importance = 1.0
    _square(Mesh, world, LED_SIDE, (-0.5 * spacing, 0, 0), led)
    plate = _square(Mesh, world, 4.0, (0, 0, z), Lambert(ConstantSF(1.0)))
    pipeline = PowerPipeline0D(accumulate=False)
    pixel = TargetedPixel(
        [plate],
        targeted_path_prob=1.0,
        x_width=DETECTOR[0],
        y_width=DETECTOR[1],
        pipelines=[pipeline],
        parent=world,
        transform=translate(0.5 * spacing, 0, 0),
        quiet=True,
        spectral_bins=1,
        min_wavelength=924.5,
        max_wavelength=925.5,
        ray_extinction_prob=0,
        ray_max_depth=3,
        ray_important_path_weight=IMPORTANT,
    )

    def estimate(samples: int, seed: int) -> np.ndarray:
        set_seed(seed)
        pixel.pixel_samples = samples
        pixel.observe()
        return np.array([pipeline.value.mean])

    return estimate


def _square(mesh_type, world, side: float, centre, material):
    x, y, z = centre
    h = 0.5 * side
    vertices = [(x - h, y - h, z), (x + h, y - h, z), (x + h, y + h, z), (x - h, y + h, z)]
    return mesh_type(vertices, [(0, 1, 2), (0, 2, 3)], smoothing=False, closed=False, parent=world, material=material)
