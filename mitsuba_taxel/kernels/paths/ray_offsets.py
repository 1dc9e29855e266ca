"""Rays that start at a surface, with the smallest offset that single precision allows."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.taxel_pair import TaxelPair


def leave(p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float) -> mi.Ray3f:
    """A ray from a point of a surface in direction ``d``. Its origin is moved by the smallest distance at which it does
    not hit that surface.

    Mitsuba moves the origin by 9e-5 (1 + max|p|): the reading of a plate at 0.1 mm is then half a percent too large,
    and a scene in metres is entirely wrong. Here the offset is what single precision requires: ``clearance`` (see
    :func:`clearance_of`) plus 1e-6 of the distance from the scene's origin. It is along the normal, since a step along
    the ray may pass through the adjacent wall at an edge.

    Parameters
    ----------
    p, n : mi.Point3f, mi.Vector3f
        A point of a surface and its normal there.
    d : mi.Vector3f
        Direction, of length 1.
    clearance : mi.Float
        Part of the offset from the surface in mm, by :func:`clearance_of`.

    Returns
    -------
    mi.Ray3f
        An unbounded ray.
    """
    return mi.Ray3f(_cleared(p, n, d, clearance), d)


def between(
    p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float, target: mi.Point3f, target_n: mi.Vector3f
) -> mi.Ray3f:
    """A ray from a point of one surface to a point of another, which hits neither of these surfaces; see :func:`leave`.

    Parameters
    ----------
    p, n : mi.Point3f, mi.Vector3f
        A point of a surface and its normal there.
    d : mi.Vector3f
        Direction to the target.
    clearance : mi.Float
        Part of the offset from the surface in mm, by :func:`clearance_of`.
    target, target_n : mi.Point3f, mi.Vector3f
        Point of the other surface and its normal there.

    Returns
    -------
    mi.Ray3f
        A ray that ends just before the target.
    """
    origin = _cleared(p, n, d, clearance)
    rest = _cleared(target, target_n, -d, clearance) - origin
    distance = dr.norm(rest)
    return mi.Ray3f(origin, rest / distance, distance * (1 - 1e-3), 0.0, dr.zeros(mi.Color0f))


def release(p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float) -> mi.Ray3f:
    """A ray from a flat face without adjacent walls. Its origin is moved along the ray, which causes no bias there.

    Parameters
    ----------
    p, n : mi.Point3f, mi.Vector3f
        A point of a flat face and its normal.
    d : mi.Vector3f
        Direction, of length 1.
    clearance : mi.Float
        Part of the offset from the surface in mm, by :func:`clearance_of`.

    Returns
    -------
    mi.Ray3f
        An unbounded ray.
    """
    offset = _offset(p, clearance)
    return mi.Ray3f(p + d * dr.minimum(offset / dr.abs(dr.dot(n, d)), 20 * offset), d)


def _cleared(p: mi.Point3f, n: mi.Vector3f, d: mi.Vector3f, clearance: mi.Float) -> mi.Point3f:
    """Point of a surface, moved along the normal by the offset that a ray needs, to the side into which ``d`` points.
    """
    return p + n * dr.mulsign(_offset(p, clearance), dr.dot(n, d))


def _offset(p: mi.Point3f, clearance: mi.Float) -> mi.Float:
    """Offset in mm that a ray's origin at ``p`` needs in single precision."""
    return dr.fma(1e-6, dr.max(dr.abs(p)), clearance)


def clearance_of(scene: mi.Scene, pair: TaxelPair) -> mi.Float:
    """Part of a ray's offset that is proportional to the size of the faces, so that it suits any unit of length.

    The precision of intersections by OptiX is relative to the size of the triangle: a plate of 140 mm shades points up
    to 6e-6 mm below itself. On a GPU the extent of the scene, which is the largest possible size of a triangle, adds to
    the clearance.

    Parameters
    ----------
    scene : mi.Scene
        The scene.
    pair : TaxelPair
        LED and phototransistor.

    Returns
    -------
    mi.Float
        Offset in mm.
    """
    clearance = 2e-6 * dr.sqrt(pair.sensor.faces.area)
    if dr.backend_v(mi.Float) == dr.JitBackend.CUDA:
        clearance += dr.opaque(mi.Float, 1e-7 * dr.max(scene.bbox().extents()))
    return clearance
