"""Walls of Mitsuba's own that reflect on one side only, and turn the other one to an LED."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import kind_of, make_plugin
from mitsuba_taxel.kernels.protocols import LedEmitter, is_led, is_wall
from mitsuba_taxel.kernels.walls import walls_by_region, walls_of

_RAYS = 1024
_NEGLIGIBLE = 0.01
"""Share of an LED's light that may meet a back without a word."""


def dark_backs(scene: mi.Scene) -> dict[int, str]:
    """What to say of each shape that turns a black back to an LED, by its number among the shapes of the scene.

    Light of each LED is followed to the first wall; one is black on its back if it returns nothing there of what it
    would return on its front.

    Parameters
    ----------
    scene : mi.Scene
        A loaded one.

    Returns
    -------
    dict[int, str]
        Sentences by the number of the shape.
    """
    if not any(wall is not None and _is_one_sided(wall) for wall in walls_of(scene)):
        return {}
    said = {}
    numbers = [int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for shape in scene.shapes()]
    for led in filter(is_led, scene.emitters()):
        hits = _hits(scene, led)
        for place, (shape, number) in enumerate(zip(scene.shapes(), numbers, strict=True)):
            walls = [wall for wall in walls_by_region(shape.bsdf()).values() if _is_one_sided(wall)]
            if walls and np.mean(hits == number) > _NEGLIGIBLE:
                which = " ".join(filter(None, (kind_of(shape), repr(shape.id()) if shape.id() else "")))
                said[place] = (
                    f"{which}: its back faces the LED, where {kind_of(walls[0])} is black: turn it round, or use wall "
                    "or twosided"
                )
    return said


def _is_one_sided(wall: mi.BSDF) -> bool:
    return not (is_wall(wall) or wall.flags() & mi.BSDFFlags.BackSide)


def _hits(scene: mi.Scene, led: LedEmitter) -> np.ndarray:
    """(_RAYS,) number of the shape whose black back a ray of some LED meets first, 0 if it meets none."""
    sampler = make_plugin("owen_sobol", sample_count=_RAYS)
    sampler.seed(0, _RAYS)
    index = sampler.index % dr.opaque(mi.UInt32, led.faces.count)
    point, direction = led.sample_point(index, sampler.next_2d()), led.sample_direction_of_emission(sampler.next_2d())
    place, passed = led.leave(index, point, direction)
    ray = mi.Ray3f(place + 1e-4 * dr.sqrt(led.area) * led.faces.frame.n, direction)
    si = scene.ray_intersect(ray, passed > 0)
    behind = si.is_valid() & (si.wi.z < 0)
    context, first, second = mi.BSDFContext(mi.TransportMode.Importance), sampler.next_1d(), sampler.next_2d()
    _, back = si.bsdf().sample(context, si, first, second, behind)
    si.wi.z = -si.wi.z
    _, front = si.bsdf().sample(context, si, first, second, behind)
    black = behind & (dr.max(back) == 0) & (dr.max(front) > 0)
    return dr.select(black, dr.reinterpret_array(mi.UInt32, si.shape), 0).numpy()
