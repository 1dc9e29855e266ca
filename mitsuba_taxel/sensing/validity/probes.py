"""Test rays that detect scenes whose readings cannot be computed: light that is never absorbed, or gaps that light
paths hardly enter."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import kind_of, make_plugin
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.kernels.paths.ray_offsets import clearance_of, release
from mitsuba_taxel.kernels.protocols import has_faces, is_led
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.walls import reflectance_of, scatters, set_wavelength, wall_at
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.sensing.validity.ray_paths import PathStep, emit, follow

NARROWEST_GAP = 0.14
"""Smallest distance between a phototransistor and the wall above it, relative to its distance from the LED, for
`taxel_path`. In narrower gaps, one path in a thousand finds the light, with a much larger weight than all other paths,
and 256 points may miss it."""
_PATHS, _REFLECTIONS, _LEFT = 256, 4096, 0.75
"""Number of paths, number of reflections, and largest fraction of the light that may remain after these reflections. If
this fraction remains, 1e-4 remains after 131072 reflections."""


def refuse_unreadable(scene: mi.Scene, integrator: mi.Integrator) -> None:
    """Raise an error for a scene whose light is never absorbed, or whose LED is hardly ever found by paths of
    `taxel_path`.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.
    integrator : mi.Integrator
        The integrator that traces its light.

    Raises
    ------
    ComputationError
        if one of both is detected; the message has a remedy.
    """
    if getattr(integrator, "max_depth", None) in (None, -1):
        _refuse_endless_light(scene)
    if kind_of(integrator) == "taxel_path":
        _refuse_narrow_gaps(scene)


def _refuse_endless_light(scene: mi.Scene) -> None:
    """Raise `ComputationError` if most of the light remains after `_REFLECTIONS` reflections."""
    ends = (*scene.emitters(), *scene.sensors())
    if not all(has_faces(end) and _may_return_all(end) for end in ends):
        return  # in a closed cavity light reaches the faces, and ends there
    for pair in taxels_of(scene):
        set_wavelength(scene, [pair.led])
        if float(pair.led.power[0]) > 0 and _remaining_fraction(scene, pair) > _LEFT:
            raise ComputationError(
                f"light in a closed cavity is not absorbed anywhere: most of it remains after {_REFLECTIONS} "
                "reflections, so that a reading has no limit. Let LED, phototransistor or a wall reflect less."
            )


def _may_return_all(end: mi.Endpoint) -> bool:
    """Whether the face of an LED or phototransistor may reflect practically all light: it absorbs less than 1e-4, or
    its reflectance is unknown."""
    cover = end.get_shape().bsdf()
    name = "led" if is_led(end) else "phototransistor"
    wall = wall_at(cover, name)
    if wall is None or scatters(wall, "absorbing"):
        return False
    reflectance = reflectance_of(wall)
    return reflectance is None or reflectance > 1 - 1e-4


def _remaining_fraction(scene: mi.Scene, pair: TaxelPair) -> float:
    """Fraction of the light of LEDs that remains after `_REFLECTIONS` reflections."""
    sampler = make_plugin("owen_sobol", sample_count=_PATHS)
    sampler.seed(0, _PATHS)
    index = sampler.index % dr.opaque(mi.UInt32, pair.count)
    remaining = dr.zeros(mi.Float, _PATHS)
    lane = dr.arange(mi.UInt32, _PATHS)

    def count(step: PathStep) -> None:
        dr.scatter(remaining, 1.0, lane, step.hit & (step.onward > 0) & (step.depth >= _REFLECTIONS))

    _, ray, _ = emit(scene, pair, index, sampler)
    follow(
        scene, ray, mi.Float(1) + dr.zeros(mi.Float, _PATHS), clearance_of(scene, pair), sampler, _REFLECTIONS, 0, count
    )
    return float(np.mean(remaining.numpy()))


def _refuse_narrow_gaps(scene: mi.Scene) -> None:
    """Raise `ComputationError` if a wall is too close above a phototransistor for `taxel_path`."""
    for pair in taxels_of(scene):
        sensors, leds = pair.sensor.window.faces.centres, pair.led.window.faces.centres
        normal = pair.sensor.normal
        gap = scene.ray_intersect(release(sensors, normal, normal, clearance_of(scene, pair))).t
        ratio = np.array(gap / dr.norm(leds - sensors), dtype=float)
        if pair.coplanar and np.any(ratio < NARROWEST_GAP):
            taxel = int(np.argmin(ratio)) + 1
            raise ComputationError(
                f"taxel_path: the gap above the phototransistor of taxel {taxel} is {ratio.min():.2g} of its distance "
                "from the LED, so that hardly any path finds the light: use taxel_tracer."
            )
