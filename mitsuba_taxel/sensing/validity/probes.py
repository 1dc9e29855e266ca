"""Test rays that detect unreadable scenes: light that never ends, and gaps that paths hardly enter."""

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
"""Least distance from a phototransistor to the wall before it, relative to that from its LED, for `taxel_path`: below,
one path in a thousand finds the light, with far more weight than all others, and 256 points may miss it."""
_PATHS, _REFLECTIONS, _LEFT = 256, 4096, 0.75
"""If this share of the light is left after these reflections, 1e-4 is left after 131072 reflections."""


def refuse_unreadable(scene: mi.Scene, integrator: mi.Integrator) -> None:
    """Raise a ComputationError for a scene whose light never ends, or is hardly found by paths of `taxel_path`."""
    if getattr(integrator, "max_depth", None) in (None, -1):
        _refuse_endless_light(scene)
    if kind_of(integrator) == "taxel_path":
        _refuse_narrow_gaps(scene)


def _refuse_endless_light(scene: mi.Scene) -> None:
    ends = (*scene.emitters(), *scene.sensors())
    if not all(has_faces(end) and _may_return_all(end) for end in ends):
        return  # in a closed cavity light reaches the faces, and ends there
    for pair in taxels_of(scene):
        set_wavelength(scene, [pair.led])
        if float(pair.led.power[0]) > 0 and _share_under_way(scene, pair) > _LEFT:
            raise ComputationError(
                f"light in a closed cavity is not absorbed anywhere: after {_REFLECTIONS} reflections most of it is "
                "still under way, and a reading has no limit. Let LED, phototransistor or a wall reflect less."
            )


def _may_return_all(end: mi.Endpoint) -> bool:
    """Whether the face of an LED or a phototransistor reflects all light but 1e-4, or its reflectance is unknown."""
    cover = end.get_shape().bsdf()
    name = "led" if is_led(end) else "phototransistor"
    wall = wall_at(cover, name)
    if wall is None or scatters(wall, "absorbing"):
        return False
    reflectance = reflectance_of(wall)
    return reflectance is None or reflectance > 1 - 1e-4


def _share_under_way(scene: mi.Scene, pair: TaxelPair) -> float:
    sampler = make_plugin("owen_sobol", sample_count=_PATHS)
    sampler.seed(0, _PATHS)
    index = sampler.index % dr.opaque(mi.UInt32, pair.count)
    left = dr.zeros(mi.Float, _PATHS)
    lane = dr.arange(mi.UInt32, _PATHS)

    def count(step: PathStep) -> None:
        dr.scatter(left, 1.0, lane, step.hit & (step.onward > 0) & (step.depth >= _REFLECTIONS))

    _, ray, _ = emit(scene, pair, index, sampler)
    follow(
        scene, ray, mi.Float(1) + dr.zeros(mi.Float, _PATHS), clearance_of(scene, pair), sampler, _REFLECTIONS, 0, count
    )
    return float(np.mean(left.numpy()))


def _refuse_narrow_gaps(scene: mi.Scene) -> None:
    for pair in taxels_of(scene):
        places, sources = pair.sensor.window.faces.centres, pair.led.window.faces.centres
        normal = pair.sensor.normal
        gap = scene.ray_intersect(release(places, normal, normal, clearance_of(scene, pair))).t
        share = np.array(gap / dr.norm(sources - places), dtype=float)
        if pair.coplanar and np.any(share < NARROWEST_GAP):
            taxel = int(np.argmin(share)) + 1
            raise ComputationError(
                f"taxel_path: before the phototransistor of taxel {taxel} lies a gap of {share.min():.2g} of its "
                "distance from the LED, through which hardly a path finds the light: use taxel_tracer."
            )
