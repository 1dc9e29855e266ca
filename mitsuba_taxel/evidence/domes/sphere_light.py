"""Reference values of the light in a cell with a spherical roof, by quadrature and ray tracing without finite elements,
triangles or a renderer.

Lengths are in mm, and heights are above the plane of LED and phototransistor. Powers are in W per W of an LED that
emits uniformly over its square and over the solid angle of its cone. All other surfaces absorb.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.special import erf
from scipy.stats import qmc

RADIUS = 1.275
"""Radius of the cell's mouth, in mm."""
BOARD = 0.5
"""Height of the plane of LED and phototransistor above the board, in mm."""
LED, WIDTH, DEPTH = 0.25, 0.52, 0.3
"""Side of the LED, and sides of the phototransistor along x and y, in mm."""
CONE = math.radians(88.0)
"""Half the apex angle of the LED's cone, in radians."""


def gauss(low, high, count):
    """Nodes and weights of the Gauss-Legendre quadrature on an interval.

    Parameters
    ----------
    low, high : float or ndarray
        Ends of the interval; arrays for several intervals.
    count : int
        Number of nodes.

    Returns
    -------
    nodes, weights : (..., count) ndarray
        Nodes and weights of each interval, along the last axis.
    """
    x, w = np.polynomial.legendre.leggauss(count)
    half = 0.5 * (np.asarray(high) - low)[..., None]
    return np.asarray(low)[..., None] + half * (x + 1), half * w


@dataclass(frozen=True)
class Dome:
    """A dome: the cap of a sphere of ``radius``. Its rim has the width of the cell, and lies at the height ``rim``
    above the LED."""

    radius: float
    rim: float
    spacing: float

    @cached_property
    def centre(self) -> np.ndarray:
        return np.array([0.0, 0.0, self.rim - math.sqrt(self.radius**2 - RADIUS**2)])

    @cached_property
    def widest(self) -> float:
        """Polar angle of the dome's rim in radians, seen from the centre of the sphere."""
        return math.asin(RADIUS / self.radius)

    def at(self, polar, azimuth):
        """Points of the sphere at polar angles and azimuths about its axis."""
        sine = np.sin(polar)
        direction = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar) + 0 * azimuth], axis=-1)
        return self.centre + self.radius * direction

    # ---- walls that scatter in all directions

    def diffuse_power(self, law: str, count: int = 36) -> float:
        """Power on the phototransistor with a diffuse roof of reflectance 1.

        Parameters
        ----------
        law : str
            ``lambertian`` or ``isotropic``.
        count : int
            Number of quadrature points along the meridian.

        Returns
        -------
        float
            Power in W.
        """
        # Points of the roof, and their areas.
        polar, weight = gauss(0.0, self.widest, count)
        azimuth = 2 * math.pi * np.arange(2 * count) / (2 * count)
        weight = np.repeat(weight * np.sin(polar), 2 * count) * self.radius**2 * math.pi / count
        points = self.at(*np.broadcast_arrays(polar[:, None], azimuth)).reshape(-1, 3)
        # Response to light at each point: directly, and after further reflections.
        direct = direct_response(points, (self.centre - points) / self.radius, law, self.spacing)
        if law == "lambertian":  # each part of a sphere lights all others equally
            fraction = weight / (4 * math.pi * self.radius**2)
            value = direct + fraction @ direct / (1 - fraction.sum())
        else:
            value = self._isotropic(points, polar, weight, direct)
        # Mean over the light of the LED, by interpolation between the points.
        grid = value.reshape(count, -1)
        columns = np.concatenate([azimuth[-8:] - 2 * math.pi, azimuth, azimuth[:8] + 2 * math.pi])
        spline = RectBivariateSpline(polar, columns, np.concatenate([grid[:, -8:], grid, grid[:, :8]], axis=1))
        return self._emitted(spline)

    def _isotropic(self, points, polar, weight, direct):
        """Fraction of the light arriving at each point of an isotropic roof that finally reaches the phototransistor.

        It solves an integral equation: the response at a point is the direct response plus the integral over the cap of
        the response / (4 pi R r), at the distance r, because cos / r^2 is 1 / (2 R r) on a sphere of radius R. The
        singularity of the kernel is subtracted: its integral over the cap is known along each direction.
        """
        distance = np.linalg.norm(points[:, None] - points, axis=2)
        np.fill_diagonal(distance, np.inf)
        kernel = weight / (4 * math.pi * self.radius * distance)
        angle, angle_weight = gauss(0.0, math.pi, 200)
        a, b = np.cos(polar)[:, None], np.sin(polar)[:, None] * np.cos(angle)
        far = np.arctan2(b, a) + np.arccos(np.clip(math.cos(self.widest) / np.hypot(a, b), -1, 1))
        kernel_integral = np.repeat(2 * np.sin(0.5 * far) @ angle_weight / (2 * math.pi), len(points) // len(polar))
        self_coupling = kernel_integral - kernel.sum(axis=1)
        value = direct
        for _ in range(80):
            value = direct + kernel @ value + self_coupling * value
        return value

    def _emitted(self, value) -> float:
        """Mean of ``value`` over the light that the LED sends to the roof."""
        side, w = gauss(-0.5 * LED, 0.5 * LED, 5)
        azimuth = 2 * math.pi * (np.arange(128) + 0.5) / 128
        x, y, phi = (a.ravel() for a in np.meshgrid(side - 0.5 * self.spacing, side, azimuth, indexing="ij"))
        area = np.repeat(np.outer(w, w).ravel() / LED**2, len(azimuth)) / len(azimuth)
        along = x * np.cos(phi) + y * np.sin(phi)
        to_rim = np.sqrt(along**2 + RADIUS**2 - x**2 - y**2) - along
        steepest = np.minimum(np.arctan2(to_rim, self.rim), CONE)
        angle, weight = gauss(0 * steepest, steepest, 40)
        sine, cosine = np.sin(angle), np.cos(angle)
        direction = np.stack([sine * np.cos(phi)[:, None], sine * np.sin(phi)[:, None], cosine], axis=-1)
        start = np.stack([x, y, 0 * x], axis=1)[:, None] - self.centre
        along = (start * direction).sum(axis=2)
        t = np.sqrt(along**2 + self.radius**2 - (start**2).sum(axis=2)) - along
        hit = start + t[..., None] * direction
        polar = np.arccos(np.clip(hit[..., 2] / self.radius, -1, 1))
        arrived = value.ev(polar, np.arctan2(hit[..., 1], hit[..., 0]) % (2 * math.pi))
        return float(area @ (weight * sine * arrived).sum(axis=1) / (1 - math.cos(CONE)))

    # ---- mirrors

    def mirror_power(self, rms_slope: float = 0.0, seed: int = 0, points: int = 1 << 16) -> tuple[float, float]:
        """Power on the phototransistor with a mirror roof, by ray tracing in 16 runs.

        Parameters
        ----------
        rms_slope : float
            Roughness: root mean square slope, in degrees.
        seed : int
            Seed of the rays.
        points : int
            Number of rays of each run.

        Returns
        -------
        power, standard_error : float
            Power and its standard error in W.
        """
        runs = [self._rays(rms_slope, qmc.Sobol(24, rng=seed * 16 + run).random(points)) for run in range(16)]
        return float(np.mean(runs)), float(np.std(runs, ddof=1) / 4)

    def _rays(self, rms_slope, u):
        """Power in W on the phototransistor from each of N rays; ``u`` (N, 24) contains 24 random numbers of each ray.
        """
        x = np.stack([LED * (u[:, 0] - 0.5) - 0.5 * self.spacing, LED * (u[:, 1] - 0.5), 0 * u[:, 0]], axis=1)
        cosine = 1 - u[:, 2] * (1 - math.cos(CONE))
        sine, phi = np.sqrt(1 - cosine**2), 2 * math.pi * u[:, 3]
        d = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)
        count, weight, power = len(u), np.ones(len(u)), 0.0
        alpha = math.sqrt(2) * math.tan(math.radians(rms_slope))
        rng = np.random.default_rng(int(u[0, 0] * 2**32))
        for bounce in range(200):
            start = x - self.centre
            along = (start * d).sum(axis=1)
            t = np.sqrt(np.maximum(along**2 + self.radius**2 - (start**2).sum(axis=1), 0)) - along
            hit = start + t[:, None] * d
            on_roof = hit[:, 2] + self.centre[2] > self.rim
            lost = ~on_roof & (d[:, 2] < 0)
            down = x[lost] - d[lost] * (x[lost, 2] / d[lost, 2])[:, None]
            inside = (np.abs(down[:, 0] - 0.5 * self.spacing) < 0.5 * WIDTH) & (np.abs(down[:, 1]) < 0.5 * DEPTH)
            power += weight[lost] @ inside
            x, d, weight, hit = (value[on_roof] for value in (hit + self.centre, d, weight, hit))
            u = u[on_roof]
            if not len(x):
                break
            normal = -hit / self.radius
            if rms_slope:
                v = u[:, 4 + 2 * bounce : 6 + 2 * bounce] if bounce < 10 else rng.random((len(x), 2))
                d, factor = reflected_at_facets(-d, normal, alpha, v)
                weight = weight * factor
            else:
                d = d - 2 * (d * normal).sum(axis=1, keepdims=True) * normal
        return power / count


def direct_response(points, normals, law, spacing):
    """Fraction of the light scattered at each point of a roof that reaches the phototransistor directly.

    Parameters
    ----------
    points, normals : (N, 3) ndarray
        N points in mm, with z above the LED, and their unit normals, which point into the cell.
    law : str
        ``lambertian`` or ``isotropic``.
    spacing : float
        Distance between LED and phototransistor, mm.

    Returns
    -------
    (N,) ndarray
        Fractions for a roof of reflectance 1.
    """
    x, wx = gauss(0.5 * spacing - 0.5 * WIDTH, 0.5 * spacing + 0.5 * WIDTH, 6)
    y, wy = gauss(-0.5 * DEPTH, 0.5 * DEPTH, 6)
    target = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((6, 6))], axis=-1).reshape(-1, 3)
    connection = target - points[:, None]
    distance = np.linalg.norm(connection, axis=2)
    down = points[:, 2:] / distance
    density = 0.5 / math.pi
    if law == "lambertian":
        density = np.einsum("pqi,pi->pq", connection, normals) / distance / math.pi
    return (density * down / distance**2) @ np.outer(wx, wy).ravel()


def reflected_at_facets(wi, normal, alpha, v):
    """Reflect rays at microfacets whose normals are sampled from Beckmann's distribution.

    Parameters
    ----------
    wi, normal : (N, 3) ndarray
        Directions back towards the origin of each of N rays, and normals of the wall.
    alpha : float
        Roughness of Beckmann's distribution: sqrt(2) times the tangent of the root mean square slope.
    v : (N, 2) ndarray
        Two random numbers for each ray.

    Returns
    -------
    directions : (N, 3) ndarray
        Directions of the reflected rays.
    weights : (N,) ndarray
        Weights of the reflected rays.
    """
    cosine = 1 / np.sqrt(1 - alpha**2 * np.log1p(-v[:, 0]))
    sine, phi = np.sqrt(1 - cosine**2), 2 * math.pi * v[:, 1]
    helper = np.where(np.abs(normal[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    s = np.cross(normal, helper)
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    t = np.cross(normal, s)
    m = (sine * np.cos(phi))[:, None] * s + (sine * np.sin(phi))[:, None] * t + cosine[:, None] * normal
    towards = (wi * m).sum(axis=1)
    wo = 2 * towards[:, None] * m - wi
    before, after = (wi * normal).sum(axis=1), (wo * normal).sum(axis=1)
    factor = np.where((after > 0) & (towards > 0), towards / (before * cosine), 0.0)
    return wo, factor * _visible(before, alpha) * _visible(np.maximum(after, 1e-9), alpha)


def _visible(cosine, alpha):
    """Fraction of microfacets that are visible from a direction whose angle to the normal has the given cosine: Smith's
    G1 for Beckmann's distribution."""
    a = cosine / (alpha * np.sqrt(np.maximum(1 - cosine**2, 1e-30)))
    return 2 / (1 + erf(a) + np.exp(-(a**2)) / (a * math.sqrt(math.pi)))


SPACING = 0.6
"""Distance of LED and phototransistor of the domes."""
DOMES = {
    "hemispheric": Dome(1.275, 0.0, SPACING),
    "spherical": Dome(2.55, 1.1 - (2.55 - math.sqrt(2.55**2 - 1.275**2)), SPACING),
}
"""Domes of the paper's pads. The rim of the hemisphere is as high as LED and phototransistor."""
