"""Reference values of the light in a cell with a flat, round roof, by quadrature and ray tracing without finite
elements, triangles or a renderer.

Lengths are in mm, and heights are above the plane of LED and phototransistor. Powers are in W per W of an LED that
emits uniformly over its square and over the solid angle of its cone. All walls except the roof absorb, and do not hide
the roof.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from mitsuba_taxel.evidence.domes.sphere_light import (
    CONE,
    DEPTH,
    LED,
    WIDTH,
    direct_response,
    gauss,
    reflected_at_facets,
)

DOWN = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class FlatRoof:
    """A horizontal disc of ``radius`` at the height ``height`` above LED and phototransistor."""

    radius: float
    height: float
    spacing: float

    def diffuse_power(self, law: str, count: int = 36) -> float:
        """Power on the phototransistor with a diffuse roof of reflectance 1. Light is reflected only once, because a
        flat roof does not illuminate itself.

        Parameters
        ----------
        law : str
            ``lambertian`` or ``isotropic``.
        count : int
            Number of quadrature points along a radius of the roof.

        Returns
        -------
        float
            Power in W.
        """
        # Points of the roof, and their areas.
        r, weight = gauss(0.0, self.radius, count)
        azimuth = 2 * math.pi * np.arange(2 * count) / (2 * count)
        x, y = (np.outer(r, trace).ravel() for trace in (np.cos(azimuth), np.sin(azimuth)))
        area = np.repeat(r * weight, 2 * count) * math.pi / count
        points = np.stack([x, y, np.full_like(x, self.height)], axis=1)
        # Irradiance by the LED: its intensity, times the cosine at the roof over the squared distance.
        side, w = gauss(-0.5 * LED, 0.5 * LED, 8)
        u, v = (a.ravel() for a in np.meshgrid(side - 0.5 * self.spacing, side, indexing="ij"))
        distance = np.sqrt((x[:, None] - u) ** 2 + (y[:, None] - v) ** 2 + self.height**2)
        inside = self.height / distance >= math.cos(CONE)
        irradiance = (inside * self.height / distance**3) @ np.outer(w, w).ravel() / LED**2
        irradiance /= 2 * math.pi * (1 - math.cos(CONE))
        response = direct_response(points, np.tile(DOWN, (len(points), 1)), law, self.spacing)
        return float(area @ (irradiance * response))

    def mirror_power(self, rms_slope: float = 0.0, seed: int = 0, points: int = 1 << 16) -> tuple[float, float]:
        """Power on the phototransistor with a mirror roof: by the image of the LED if the roof is smooth, by ray
        tracing in 16 runs if it is rough.

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
        if not rms_slope:
            return self._of_image(), 0.0
        runs = [self._rays(rms_slope, qmc.Sobol(6, rng=seed * 16 + run).random(points)) for run in range(16)]
        return float(np.mean(runs)), float(np.std(runs, ddof=1) / 4)

    def _of_image(self) -> float:
        """Power on the phototransistor from the mirror image of the LED at twice the height, seen through the disc of
        the roof."""
        side, w = gauss(-0.5 * LED, 0.5 * LED, 10)
        x, wx = gauss(0.5 * self.spacing - 0.5 * WIDTH, 0.5 * self.spacing + 0.5 * WIDTH, 10)
        y, wy = gauss(-0.5 * DEPTH, 0.5 * DEPTH, 10)
        u, v, x, y = np.meshgrid(side - 0.5 * self.spacing, side, x, y, indexing="ij")
        distance = np.sqrt((x - u) ** 2 + (y - v) ** 2 + (2 * self.height) ** 2)
        seen = (np.hypot(x + u, y + v) < 2 * self.radius) & (2 * self.height / distance >= math.cos(CONE))
        irradiance = seen * 2 * self.height / distance**3
        return (
            float(np.einsum("uvxy,u,v,x,y", irradiance, w, w, wx, wy)) / LED**2 / (2 * math.pi * (1 - math.cos(CONE)))
        )

    def _rays(self, rms_slope: float, u: np.ndarray) -> float:
        """Power in W on the phototransistor from each of N rays; ``u`` (N, 6) contains six random numbers of each ray.
        """
        # Rays from the LED to the plane of the roof.
        origin = np.stack([LED * (u[:, 0] - 0.5) - 0.5 * self.spacing, LED * (u[:, 1] - 0.5), 0 * u[:, 0]], axis=1)
        cosine = 1 - u[:, 2] * (1 - math.cos(CONE))
        sine, phi = np.sqrt(1 - cosine**2), 2 * math.pi * u[:, 3]
        direction = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)
        hit = origin + (self.height / cosine)[:, None] * direction
        on_roof = np.hypot(hit[:, 0], hit[:, 1]) < self.radius
        hit, direction, v = hit[on_roof], direction[on_roof], u[on_roof, 4:]
        # Reflection, and the way down to the phototransistor.
        alpha = math.sqrt(2) * math.tan(math.radians(rms_slope))
        direction, weight = reflected_at_facets(-direction, np.tile(DOWN, (len(hit), 1)), alpha, v)
        down = hit + direction * (-self.height / direction[:, 2])[:, None]
        inside = (np.abs(down[:, 0] - 0.5 * self.spacing) < 0.5 * WIDTH) & (np.abs(down[:, 1]) < 0.5 * DEPTH)
        return float(weight @ (inside & (direction[:, 2] < 0))) / len(u)
