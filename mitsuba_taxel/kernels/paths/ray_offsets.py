"""Rays that leave a surface, with the smallest offset that single precision allows."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.taxel_pair import TaxelPair


def leave(p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float) -> mi.Ray3f:
    """A ray from a point of a surface in direction ``d``, clear of that surface.

    Mitsuba moves the origin by 9e-5 (1 + max|p|): a plate at 0.1 mm then reads half a percent too much, and a scene in
    metres is wrong altogether. Here the offset is only what single precision requires: ``clearance`` (see
    :func:`clearance_of`) plus 1e-6 of the distance from the scene's origin. It is along the normal, since a step along
    the ray may lead through the adjacent wall at an edge.

    Parameters
    ----------
    p, n : mi.Point3f, mi.Vector3f
        A point of a surface and its normal there.
    d : mi.Vector3f
        Direction, of length 1.
    clearance : mi.Float
        See :func:`clearance_of`.

    Returns
    -------
    mi.Ray3f
        Without an end.
    """
    return mi.Ray3f(_cleared(p, n, d, clearance), d)


def between(
    p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float, target: mi.Point3f, target_n: mi.Vector3f
) -> mi.Ray3f:
    """As :func:`leave`, up to a point of another surface with normal ``target_n``, and clear of that as well.

    Parameters
    ----------
    p, n : mi.Point3f, mi.Vector3f
        A point of a surface and its normal there.
    d : mi.Vector3f
        Direction to the target.
    clearance : mi.Float
        See :func:`clearance_of`.
    target, target_n : mi.Point3f, mi.Vector3f
        The other point and normal.

    Returns
    -------
    mi.Ray3f
        That ends before the target.
    """
    origin = _cleared(p, n, d, clearance)
    rest = _cleared(target, target_n, -d, clearance) - origin
    distance = dr.norm(rest)
    return mi.Ray3f(origin, rest / distance, distance * (1 - 1e-3), 0.0, dr.zeros(mi.Color0f))


def release(p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float) -> mi.Ray3f:
    """As :func:`leave` for a ray from a flat face with no wall beside it: the ray stays on its line, without bias.

    Parameters
    ----------
    p, n : mi.Point3f, mi.Vector3f
        A point of a flat face and its normal.
    d : mi.Vector3f
        Direction, of length 1.
    clearance : mi.Float
        See :func:`clearance_of`.

    Returns
    -------
    mi.Ray3f
        Without an end.
    """
    offset = _offset(p, clearance)
    return mi.Ray3f(p + d * dr.minimum(offset / dr.abs(dr.dot(n, d)), 20 * offset), d)


def _cleared(p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float) -> mi.Point3f:
    """A point of a surface, offset to the side into which ``d`` points."""
    return p + n * dr.mulsign(_offset(p, clearance), dr.dot(n, d))


def _offset(p: mi.Point3f, clearance: mi.Float) -> mi.Float:
    return dr.fma(1e-6, dr.max(dr.abs(p)), clearance)


def clearance_of(scene: mi.Scene, pair: TaxelPair) -> mi.Float:
    """The part of a ray's offset that scales with the size of the parts, independent of the unit of length.

    The precision of OptiX's intersections is relative to the triangle's size: a plate of 140 mm shades points up to
    6e-6 mm below itself. No shape is larger than the scene.

    Parameters
    ----------
    scene : mi.Scene
        Of which the extent counts on a GPU.
    pair : TaxelPair
        Of which the area of the faces counts.

    Returns
    -------
    mi.Float
        In mm.
    """
    clearance = 2e-6 * dr.sqrt(pair.sensor.faces.area)
    if dr.backend_v(mi.Float) == dr.JitBackend.CUDA:
        clearance += dr.opaque(mi.Float, 1e-7 * dr.max(scene.bbox().extents()))
    return clearance
