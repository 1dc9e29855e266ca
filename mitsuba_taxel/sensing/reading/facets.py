"""Error of readings due to the flat triangles (facets) of curved walls and of walls with random heights.

The triangles used for readings match the curved walls on average. To estimate the remaining error, light is traced
again with inscribed triangles (chords). The error is of the same order in the triangle size as this change, and is
stated as a small fraction of it. This holds if light falls on many triangles, whose tilts cancel out; for narrow beams,
the tilts are a separate error.

Walls with random heights lose part of their slopes, because triangles are plane between vertices. Light is traced again
with a multiple of this loss.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import mitsuba as mi
import numpy as np

from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.kernels.protocols import PadShape, is_region, is_wall
from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.sensing.reading.mechanics_error import moved
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

RAYS = 1 << 14
"""Number of rays from all LEDs together, and from all phototransistors together."""
LATTICE = 1.1673039782614187
"""Root of x^5 = x + 1. The fractional parts of the multiples of its powers -1 to -4 form a quasi-random sequence in
four dimensions (M. Roberts, The unreasonable effectiveness of quasirandom sequences, 2018)."""
TANGENT = 0.7
"""Relative change of light scattered by Lambert's law, per radian of tilt: the tangent of a typical scattering angle of
35 degrees."""


def curved_pads(scene: mi.Scene) -> list[PadShape]:
    """The `deformable_pad`s of a scene whose triangles deviate from their walls."""
    return [pad for pad in deformed_pads(scene) if pad.is_curved]


@contextmanager
def with_chords(scene: mi.Scene) -> Iterator[None]:
    """Replace the triangles of curved walls by inscribed triangles (chords) within the block, and restore them
    afterwards.
    """
    pads = curved_pads(scene)
    with stages.stage("load"):
        chords = [pad.chords() for pad in pads]
    with moved(scene, pads, chords):
        yield


@contextmanager
def with_blunt_heights(scene: mi.Scene) -> Iterator[None]:
    """Reduce the slopes of random heights within the block, and restore them afterwards. The reduction is `1 /
    FACETS_SHARE` times the loss due to triangles.
    """
    with stages.stage("load"):
        blunt = [(pad, pad.blunt_heights()) for pad in deformed_pads(scene)]
    rough = [(pad, places) for pad, places in blunt if places is not None]
    with moved(scene, [pad for pad, _ in rough], [places for _, places in rough]):
        yield


def has_random_heights(scene: mi.Scene) -> bool:
    """Whether any pad of a scene has walls with random heights that triangles represent approximately."""
    pads = [pad for pad in deformed_pads(scene) if pad.finish is not None]
    if not pads:
        return False
    from mitsuba_taxel.mechanics.surface.wall_finishes import with_blunt_heights as blunted

    return any(blunted(pad.finish) is not None for pad in pads)


def tilt_share(scene: mi.Scene) -> float:
    """Relative error of readings because flat triangles are tilted against the curved walls that they replace.

    The tilt is the angle between the normals of triangle and wall. Its mean over each triangle is zero, so that its
    effect cancels under even illumination, but not if a spot covers a part of a triangle or only a few triangles. Rays
    give the mean tilt over the light of an LED, and over the area that a phototransistor sees. Power scattered by
    Lambert's law changes by the tilt times the tangent of the scattering angle; power scattered by isotropic walls does
    not change. Mirrors have no tilt, because their triangles carry the normals of the walls.

    Returns
    -------
    float
        One standard deviation, without unit: the root mean square over the cells.
    """
    ends = (scene.emitters(), scene.sensors())
    return TANGENT * math.sqrt(sum(np.mean([_square_share(scene, end) for end in kind]) for kind in ends))


def _square_share(scene: mi.Scene, end: mi.Endpoint) -> float:
    """Mean square of the relative error due to tilt, over the faces of an array of LEDs or phototransistors."""
    from mitsuba_taxel.geometry.surfaces.triangles import area_normals, unit  # a plate has no use for it

    x, y, z, w = (mi.Float((0.5 + np.arange(RAYS) * LATTICE**-k) % 1.0) for k in range(1, 5))
    ray, weight = end.sample_ray(0.0, 0.5, mi.Point2f(x, y), mi.Point2f(z, w))
    hit = scene.ray_intersect_preliminary(ray)
    power = np.broadcast_to(np.array(weight[0]), RAYS)
    square = 0.0
    for pad in curved_pads(scene):
        here = np.flatnonzero(np.array(hit.is_valid() & (hit.shape == mi.ShapePtr(pad))))
        surface, triangle = pad.surface, np.array(hit.prim_index)[here]
        u, v = np.array(hit.prim_uv)[:, here]
        normal = unit(np.einsum("kr,rki->ri", np.stack([1 - u - v, u, v]), surface.normals[triangle]))
        of_triangle = unit(area_normals(surface.vertices, surface.triangles))[triangle]
        tilt = normal - (normal * of_triangle).sum(axis=1, keepdims=True) * of_triangle
        turned = (power[here] * _turning(pad)[surface.region[triangle]])[:, None] * tilt
        of_cell = [np.bincount(surface.cell[triangle], along) for along in turned.T]
        square += float(np.square(of_cell).sum())
    return end.faces.count * square / power.sum() ** 2 if power.any() else 0.0


def _turning(pad: PadShape) -> np.ndarray:
    """Fraction of the scattered light whose direction follows the normal of the wall, for each region of a pad; indexed
    by the code of the region."""
    wall = pad.bsdf()
    walls = wall.walls if is_region(wall) else dict.fromkeys(REGIONS, wall)
    turning = np.ones(max(REGIONS.values()) + 1)
    for name, code in REGIONS.items():
        here = walls.get(name)
        if here is None:  # black
            turning[code] = 0.0
        elif is_wall(here) and (here.scattering == "isotropic" or here.specification.reflectance == 0):
            turning[code] = 0.0
        elif is_wall(here) and here.scattering == "mixed":
            turning[code] = 1 - (here.specification.isotropic or 0.0)
    turning[pad.mirrors] = 0.0
    return turning
