"""Reflected views: rays from the phototransistor that mirrors reflect, until a wall scatters.

Light that a curved mirror reflects onto the phototransistor cannot be connected from the wall before the mirror: the
point of reflection is unknown, and paths meet it only by chance. From the phototransistor the same path is a ray that
the mirror reflects, and which ends at that wall. If the response is narrow, such rays find the few points of the wall
whose light reaches the phototransistor.

A mirror conserves dA cos(theta) dw, with angles to the normal of a point z of a wall and of the phototransistor y:

    dA_z cos(theta_z) dw_z K = dA_y cos(theta_y) dw_y.

K is 1, except where the normal of a mirror is interpolated and differs from that of its triangle. Reflection by the
interpolated normal conserves dw at a point, while the area of a beam changes by the cosines to the triangle: K is the
product over the mirrors of |cos(out)| / |cos(in)| in the direction of the light. The densities of reflected views and
of hits have therefore a ratio that does not depend on the curvature of mirrors.
"""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.paths.ray_offsets import leave
from mitsuba_taxel.kernels.protocols import is_wall
from mitsuba_taxel.kernels.walls import walls_of

MOST_MIRRORS = 4
"""Largest number of mirrors between the phototransistor and the wall that scatters."""


class ViewRay(NamedTuple):
    """A ray that starts at a phototransistor and is traced against the light: origin, direction and probability
    density.
    """

    exit_point: mi.Point3f
    direction: mi.Vector3f
    cosine: mi.Float  # of its angle to the normal
    density: mi.Float  # 1/sr: of its direction


class ReflectedEnd(NamedTuple):
    """End of a ray that starts at the phototransistor and is reflected by mirrors: the point of the first wall that
    scatters, and the factors of the mirrors.
    """

    si: mi.SurfaceInteraction3f  # at the wall that scatters
    direction: mi.Vector3f  # in which the ray arrives
    valid: mi.Bool
    weight: mi.Float  # reflectances over probabilities
    stretch: mi.Float  # K
    distance: mi.Float  # mm: from the first mirror
    specular: mi.Float  # probability with which light is reflected by the first mirror
    ends: mi.Float  # probability with which the view ends here
    mirrors: mi.UInt32


def follows_mirrors(scene: mi.Scene) -> tuple[bool, bool]:
    """Whether rays from the phototransistor are followed over mirrors, and whether they may end at walls that are
    partly mirrors.

    Mirrors of Mitsuba are not followed, since their reflection may be one of several.

    Parameters
    ----------
    scene : mi.Scene
        The scene.

    Returns
    -------
    follows, has_mixed : bool
        Both are False if there are no mirrors, or no walls that scatter.
    """
    # Reflectances are not read: paths are traced by recorded kernels.
    walls = [wall for wall in walls_of(scene) if wall is not None]
    mirrors = [wall for wall in walls if wall.flags() & mi.BSDFFlags.Delta]
    scattering = mi.BSDFFlags.Diffuse | mi.BSDFFlags.Glossy
    follows = bool(mirrors) and all(map(is_wall, mirrors)) and any(wall.flags() & scattering for wall in walls)
    return follows, any(wall.flags() & scattering for wall in mirrors)


def specular_probability(
    context: mi.BSDFContext, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, active: mi.Bool
) -> tuple[mi.Float, mi.Float]:
    """Probability of specular reflection by a wall, and its reflectance there.

    Parameters
    ----------
    context : mi.BSDFContext
        Direction of tracing.
    si : mi.SurfaceInteraction3f
        Point of the wall.
    bsdf : mi.BSDFPtr
        The wall.
    active : mi.Bool
        Active lanes.

    Returns
    -------
    probability, reflectance : mi.Float
        The probability is 0 for walls that are not mirrors.
    """
    # The specular component is the first of a `wall`.
    bs, weight = bsdf.sample(context, si, mi.Float(0), mi.Point2f(0.5), active)
    return dr.select(mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta), bs.pdf, 0), weight[0]


def stretch_at(si: mi.SurfaceInteraction3f, onward: mi.Vector3f) -> mi.Float:
    """Change of a beam's cross-section by a mirror with interpolated normals: the factor of light that arrives at
    ``si`` and leaves in the world direction ``onward``.

    Parameters
    ----------
    si : mi.SurfaceInteraction3f
        Point of a mirror.
    onward : mi.Vector3f
        World direction.

    Returns
    -------
    mi.Float
        The factor K. It is 0 where light is not reflected by the interpolated normal alone, because it would leave
        behind the triangle.
    """
    inward, behind = dr.abs(dr.dot(si.n, si.to_world(si.wi))), _leaves_behind(si)
    return dr.select(behind, 0, dr.abs(dr.dot(si.n, onward)) / inward)


def _leaves_behind(si: mi.SurfaceInteraction3f) -> mi.Bool:
    """Whether specular reflection by the interpolated normal leads behind the triangle."""
    normal = si.to_local(si.n)
    return dr.dot(mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z), normal) * dr.dot(si.wi, normal) <= 0


@dr.syntax
def reflected(
    scene: mi.Scene,
    context: mi.BSDFContext,
    clearance: mi.Float,
    first: mi.SurfaceInteraction3f,
    direction: mi.Vector3f,
    valid: mi.Bool,
    choice: mi.Float,
) -> ReflectedEnd:
    """Follow rays over mirrors to the first wall that scatters.

    The first wall always reflects; at further walls that are partly mirrors, the ray ends or is reflected by chance.

    Parameters
    ----------
    scene : mi.Scene
        The scene.
    context : mi.BSDFContext
        Direction of tracing.
    clearance : mi.Float
        Part of the offset from the surface in mm, by :func:`clearance_of`. See
        :func:`mitsuba_taxel.kernels.paths.ray_offsets.leave`.
    first : mi.SurfaceInteraction3f
        Where rays from the phototransistor meet a wall.
    direction : mi.Vector3f
        World direction in which they arrive.
    valid : mi.Bool
        Whether they meet a wall.
    choice : mi.Float
        Uniform random numbers.

    Returns
    -------
    ReflectedEnd
        Ends of the views; not valid where the first wall is no mirror, or no wall scatters.
    """
    si, direction, choice = mi.SurfaceInteraction3f(first), mi.Vector3f(direction), mi.Float(choice)
    weight, stretch, distance = mi.Float(1), mi.Float(1), mi.Float(0)
    of_first, ends, mirrors = mi.Float(0), mi.Float(0), mi.UInt32(0)
    active, arrived = mi.Bool(valid), mi.Bool(False)
    while active:
        specular, reflectance = specular_probability(context, si, si.bsdf(), active)
        is_first = mirrors == 0
        goes_on = (specular > 0) & (is_first | (choice < specular))

        # The end at a wall that scatters.
        arrived = active & ~is_first & ~goes_on
        ends = dr.select(arrived, 1 - specular, ends)
        weight = dr.select(arrived, weight / (1 - specular), weight)

        # Reflection.
        active &= goes_on & (mirrors < MOST_MIRRORS) & ~_leaves_behind(si)
        choice = dr.select(is_first, choice, choice / specular)
        onward = si.to_world(mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z))
        # Light travels in the opposite direction.
        ratio = dr.abs(dr.dot(si.n, direction)) / dr.abs(dr.dot(si.n, onward))
        stretch = dr.select(active, stretch * ratio, stretch)
        weight = dr.select(active, weight * reflectance * dr.select(is_first, specular, 1) / ratio, weight)
        of_first = dr.select(is_first, specular, of_first)
        mirrors += dr.select(active, mi.UInt32(1), mi.UInt32(0))
        direction = dr.select(active, onward, direction)
        following = scene.ray_intersect(leave(si.p, si.n, onward, clearance), active)
        active &= following.is_valid()
        distance = dr.select(active, distance + dr.norm(following.p - si.p), distance)
        si = dr.select(active, following, si)
    return ReflectedEnd(
        si=si,
        direction=direction,
        valid=arrived,
        weight=weight,
        stretch=stretch,
        distance=distance,
        specular=of_first,
        ends=ends,
        mirrors=mirrors,
    )
