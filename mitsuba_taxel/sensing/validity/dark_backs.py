"""Warnings of surfaces with one of Mitsuba's own BSDFs that reflects on one side only, if their black back faces an
LED."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import kind_of, make_plugin
from mitsuba_taxel.kernels.protocols import LedEmitter, is_led, is_wall
from mitsuba_taxel.kernels.walls import walls_by_region, walls_of

_RAYS = 1024
_NEGLIGIBLE = 0.01
"""Fraction of an LED's light that may meet a black back without a warning."""


def dark_backs(scene: mi.Scene) -> dict[int, str]:
    """Find shapes that face an LED with a black back, with a warning for each.

    Rays from each LED are traced to the first surface. The back of a surface is black if it reflects nothing where the
    front would reflect light.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    dict[int, str]
        Warning by the index of the shape in the scene.
    """
    if not any(wall is not None and _is_one_sided(wall) for wall in walls_of(scene)):
        return {}
    warnings = {}
    numbers = [int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for shape in scene.shapes()]
    for led in filter(is_led, scene.emitters()):
        hits = _hits(scene, led)
        for index, (shape, number) in enumerate(zip(scene.shapes(), numbers, strict=True)):
            walls = [wall for wall in walls_by_region(shape.bsdf()).values() if _is_one_sided(wall)]
            if walls and np.mean(hits == number) > _NEGLIGIBLE:
                name = " ".join(filter(None, (kind_of(shape), repr(shape.id()) if shape.id() else "")))
                warnings[index] = (
                    f"{name}: its back faces the LED, where {kind_of(walls[0])} is black: turn it round, or use wall "
                    "or twosided"
                )
    return warnings


def _is_one_sided(wall: mi.BSDF) -> bool:
    return not (is_wall(wall) or wall.flags() & mi.BSDFFlags.BackSide)


def _hits(scene: mi.Scene, led: LedEmitter) -> np.ndarray:
    """Trace `_RAYS` rays from LEDs to the first surface. Returns, for each ray, the number of the shape if the ray hits
    a black back, else 0."""
    sampler = make_plugin("owen_sobol", sample_count=_RAYS)
    sampler.seed(0, _RAYS)
    index = sampler.index % dr.opaque(mi.UInt32, led.faces.count)
    point, direction = led.sample_point(index, sampler.next_2d()), led.sample_direction_of_emission(sampler.next_2d())
    exit_point, passed = led.leave(index, point, direction)
    ray = mi.Ray3f(exit_point + 1e-4 * dr.sqrt(led.area) * led.faces.frame.n, direction)
    si = scene.ray_intersect(ray, passed > 0)
    behind = si.is_valid() & (si.wi.z < 0)
    context, first, second = mi.BSDFContext(mi.TransportMode.Importance), sampler.next_1d(), sampler.next_2d()
    _, from_back = si.bsdf().sample(context, si, first, second, behind)
    si.wi.z = -si.wi.z
    _, from_front = si.bsdf().sample(context, si, first, second, behind)
    black = behind & (dr.max(from_back) == 0) & (dr.max(from_front) > 0)
    return dr.select(black, dr.reinterpret_array(mi.UInt32, si.shape), 0).numpy()
