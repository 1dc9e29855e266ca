"""Implementation of `mi.render` for the integrators of this package."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.paths.wavefronts import trace
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.sensing.validity.modelled import refuse_unmodelled
from mitsuba_taxel.sensing.validity.probes import refuse_unreadable


def render(
    integrator: mi.Integrator,
    scene: mi.Scene,
    sensor: mi.Sensor | int = 0,
    seed: int = 0,
    spp: int = 0,
    develop: bool = True,
    evaluate: bool = True,
):
    """Render the irradiance map of the phototransistors of one sensor, in W/mm², as a tensor (height, width, channels).
    This is the method ``render`` of the integrators of this package."""
    sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
    film = sensor.film()
    refuse_unmodelled(scene, integrator)
    refuse_unreadable(scene, integrator)
    pair = next((pair for pair in taxels_of(scene) if pair.sensor is sensor), None)
    if pair is None:
        raise InputError(
            f"sensor {sensor.id()!r} is not allowed: it is a {kind_of(sensor)}; the index of a phototransistor among "
            f"the scene's sensors is needed."
        )
    _, image, _ = trace(integrator, scene, pair, spp or sensor.sampler().sample_count(), int(seed), image=True)
    assert image is not None  # as requested
    film.prepare([])
    block = film.create_block()
    height, width = image.shape
    pixel = dr.arange(mi.UInt32, height * width)
    centre = mi.Point2f(mi.Float(pixel % width), mi.Float(pixel // width)) + 0.5
    block.put(centre, dr.zeros(mi.Color0f), mi.Spectrum(mi.Float(in_packets(image))), 1.0, 1.0)
    film.put_block(block)
    result = film.develop() if develop else None
    if evaluate:
        dr.eval(result)
    return result


def refuse_derivatives(integrator: mi.Integrator, *_: Any, **__: Any) -> None:
    """Raise `InputError`: images of the integrators of this package cannot be differentiated by `dr.forward` and
    `dr.backward`."""
    raise InputError(
        f"derivatives by dr.forward or dr.backward are not available through {integrator!s}: use measure(scene, "
        f"derivatives=[...]), or differences of readings of the same seed, which share random numbers."
    )
