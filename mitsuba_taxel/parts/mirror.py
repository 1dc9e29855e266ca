"""Power that a photo-reflector receives from a flat mirror above it, with refraction at its windows, by quadrature.

Dies lie at depths d_e and d_d under clear resin of index n with flat windows, with an opaque barrier in between.
Unfolded at the mirror, a ray from a point of the emitter to a point of the detector at a lateral distance R crosses
both windows at the same angle t in air, which is the only solution of

    R = 2 h tan t + (d_e + d_d) tan t',    sin t = n sin t'.

A die that is Lambertian in the resin, of radiance L, sends the power L cos t' dW' dA_e into a solid angle dW'. With
dA_d = R dR df, the power from dA_e to dA_d is

    dP = L T(t)^2 1 / (2 n^2) d(sin^2 t)/dR / R dA_e dA_d

with Fresnel's transmittance T for unpolarised light, if both crossings lie in their windows. Explicit refraction is
therefore equivalent to an emission law at each point of a window: the radiance in air is T L / n^2 in directions whose
ray, traced back, meets the die, and 0 in others. Light reflected within the package is absorbed. A die in the plane of
its window may have another law, which is a factor that depends on the angle in air.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parts.part import Part
from mitsuba_taxel.parts.refraction import (
    POINTS,
    die_points,
    emitted_rays,
    passes_window,
    refracted,
    relative_radiance,
    sobol_points,
    transmittance,
)


class MirrorRays(NamedTuple):
    """Light reflected by a mirror, from points of the emitter to points of the detector.

    Attributes
    ----------
    places : (N, 2) ndarray
        Points of reflection, x and y in mm.
    power : (N,) ndarray
        Power of each ray, in W per W that the emitter's die sends into the resin.
    """

    places: np.ndarray
    power: np.ndarray


def mirror_rays(part: Part, height: float, points: int = POINTS) -> MirrorRays:
    """Rays from emitter to detector by a mirror of reflectance 1 that is parallel to the windows.

    Parameters
    ----------
    part : Part
        Emitter and detector.
    height : float
        Height of the mirror above the windows, mm.
    points : int
        Number of rays, a power of 2.

    Returns
    -------
    MirrorRays
        Points of reflection and powers.

    Raises
    ------
    InputError
        if the height is not above 0.
    """
    if not height > 0:
        raise InputError(f"height = {height!r} is not allowed: a number of mm above 0 is needed.")
    # Rays between random points of both dies: angle in air, power per area.
    emitter, detector = part.emitter, part.detector
    uniform = sobol_points(4, points)
    start, end = die_points(emitter, uniform[:, :2]), die_points(detector, uniform[:, 2:])
    offset = end - start
    distance = np.linalg.norm(offset, axis=1)
    depths = emitter.die_depth + detector.die_depth
    angle, geometry = refracted(part.resin_index, 2 * height, depths, distance)
    density = geometry * (transmittance(part.resin_index, np.cos(angle)) / part.resin_index) ** 2

    # Only rays that cross both windows arrive; dies in the plane of their window may follow other laws than Lambert's.
    tangent = np.sin(angle) / np.sqrt(part.resin_index**2 - np.sin(angle) ** 2)
    per_depth = offset / distance[:, None] * tangent[:, None]
    exit_point, entry_point = start + emitter.die_depth * per_depth, end - detector.die_depth * per_depth
    unobstructed = passes_window(emitter, exit_point) & passes_window(detector, entry_point)
    density = density * relative_radiance(emitter, np.cos(angle)) * detector.relative_to_lambert(np.cos(angle))
    area = detector.die_width * detector.die_length
    return MirrorRays(
        (exit_point + entry_point) / 2, np.where(unobstructed, density, 0.0) * area / np.pi / len(density)
    )


def mirror_curve(part: Part, heights: Any, points: int = POINTS) -> np.ndarray:
    """Power on the detector under a mirror of reflectance 1 that is parallel to the windows.

    Parameters
    ----------
    part : Part
        Emitter and detector.
    heights : float or (N,) array_like
        Height of the mirror above the windows, mm.
    points : int
        Number of rays per height, a power of 2.

    Returns
    -------
    (N,) ndarray
        Power in W per W that the emitter's die sends into the resin.

    Raises
    ------
    InputError
        if a height is not above 0.
    """
    return np.array([mirror_rays(part, float(height), points).power.sum() for height in np.atleast_1d(heights)])


def leaving_share(part: Part) -> float:
    """Fraction of the emitter's power that leaves its window, after refraction and reflection there.

    Parameters
    ----------
    part : Part
        Part with the emitter.

    Returns
    -------
    float
        Fraction, relative to the power that the die sends into the resin.
    """
    emitter = part.emitter
    start, heading, sine = emitted_rays(emitter, sobol_points(4))
    tangent = sine / np.sqrt(part.resin_index**2 - sine**2)
    unobstructed = passes_window(emitter, start + emitter.die_depth * tangent[:, None] * heading)
    cosine = np.sqrt(1 - sine**2)
    leaving = transmittance(part.resin_index, cosine) * relative_radiance(emitter, cosine)
    return float((leaving * unobstructed).mean() / part.resin_index**2)


def edge_positions(part: Part, height: float, axis: int, shares: Any = (0.1, 0.5, 0.9)) -> np.ndarray:
    """Positions of a mirror's straight edge at which the detector receives given fractions of its largest power.

    The largest power is that under an infinite mirror at the same height.

    Parameters
    ----------
    part : Part
        Emitter and detector.
    height : float
        Height of the mirror above the windows, mm.
    axis : int
        Axis along which the edge moves: 0 for x, 1 for y. The mirror lies on the lower side of its edge.
    shares : float or (N,) array_like
        N fractions between 0 and 1.

    Returns
    -------
    (N,) ndarray
        Position of the edge along the axis for each fraction, from the body's centre, mm.

    Raises
    ------
    InputError
        if the height is not above 0, or shares are not between 0 and 1.
    """
    rays, fractions = mirror_rays(part, height), np.atleast_1d(np.asarray(shares, dtype=float))
    if not np.all((fractions > 0) & (fractions < 1)):
        raise InputError(f"shares = {shares} are not allowed: numbers between 0 and 1 are needed.")
    order = np.argsort(rays.places[:, axis])
    covered = np.cumsum(rays.power[order])
    return np.interp(fractions * covered[-1], covered, rays.places[order, axis])
