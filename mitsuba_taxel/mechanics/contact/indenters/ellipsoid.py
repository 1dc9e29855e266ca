"""An ellipsoid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.surfaces.swept import revolved
from mitsuba_taxel.mechanics.contact.indenter_shape import ALONG, Gap, IndenterShape
from mitsuba_taxel.parameters import REQUIRED, Number

DEEPEST = 0.25
"""Depth, relative to the smallest semi-axis, beyond which the contact radius for the choice of elements is constant."""
NEAREST = 1e-12
"""Least coordinate of a point, relative to a semi-axis: in the planes of symmetry deep inside, the nearest point of the
surface is not unique."""
MOST_ITERATIONS = 100
"""Largest number of steps of Newton's method. If the method starts at a pole, each step multiplies the distance from
the pole by 3/2."""
TOLERANCE = 1e-15
"""Tolerance of the equation for the nearest point, relative to its terms."""
ROUND = 1e-6
"""Relative difference of two curvatures that count as equal."""
_AXES = ("x", "y", "z")


class Ellipsoid(IndenterShape, name="ellipsoid"):
    """An ellipsoid with one axis upright; with three equal semi-axes, a ball.

    Distances are Euclidean: the nearest point is the root of an equation in one unknown (D. Eberly, Distance from a
    Point to an Ellipse, an Ellipsoid, or a Hyperellipsoid, 2013). The width of a contact is that of Hertz's theory (K.
    L. Johnson, Contact Mechanics, 1985, section 4.2).
    """

    meaning = "an ellipsoid with an upright axis"
    uses = ("angle",)
    unbounded = False
    contact_grows = True
    finer_when_shallow = True

    @classmethod
    def own_parameters(cls) -> Mapping[str, Any]:
        where = ("along x, before it is rotated", "along y, before it is rotated", "along z")
        return {
            f"semi_axis_{axis}": Number(
                doc=f"Semi-axis of the ellipsoid {words}.", unit="mm", default=REQUIRED, above=0, common=(0.02, 500)
            )
            for axis, words in zip(_AXES, where, strict=True)
        }

    @cached_property
    def semi_axes(self) -> np.ndarray:
        """Semi-axes (3,) in mm."""
        return np.array([getattr(self.indenter, f"semi_axis_{axis}") for axis in _AXES])

    def own_gap(self, points: np.ndarray) -> Gap:
        """Signed distance of ``points`` (n, 3) in mm from the surface, negative inside, and its derivatives.

        With s the squared semi-axes and y the position from the centre, the nearest point of the surface is
        s y / (t + s), where the sum of s (y / (t + s))² is 1, and the distance is t |y / (t + s)|.
        """
        squares, from_centre = self.semi_axes**2, points - [0.0, 0.0, self.semi_axes[2]]
        magnitude = np.maximum(np.abs(from_centre), NEAREST * self.semi_axes)
        y = np.copysign(magnitude, from_centre)

        # The sum less 1 is written as its value at t = 0 plus the change from there, both without cancellation of terms
        # of about 1: gaps may be far smaller than the body, and the forces of contact follow from them.
        across, height = (points[:, :2] / self.semi_axes[:2]) ** 2, points[:, 2] / self.semi_axes[2]
        at_zero = across.sum(axis=1) + height * (height - 2)
        rounding = across.sum(axis=1) + np.abs(height * (height - 2))

        # The sum falls with t and is convex: if Newton's method starts on the left of the root, it stays there and
        # converges.
        t = (self.semi_axes * magnitude - squares).max(axis=1)
        active, relative = np.arange(len(t)), (magnitude / self.semi_axes) ** 2
        for _ in range(MOST_ITERATIONS):
            now, shifted = t[active], t[active, None] + squares
            change = now * (relative[active] * (shifted + squares) / shifted**2).sum(axis=1)
            excess = at_zero[active] - change
            slope = 2 * (relative[active] * squares**2 / shifted**3).sum(axis=1)
            t[active] = now + excess / slope
            active = active[excess > TOLERANCE * (rounding[active] + np.abs(change))]
            if not len(active):
                break

        scaled = y / (t[:, None] + squares)
        length = np.linalg.norm(scaled, axis=1)
        normal = scaled / length[:, None]
        # Derivatives of t, of the scaled position and of its direction with respect to y.
        slope = squares * scaled / (t[:, None] + squares)
        slope /= (slope * scaled).sum(axis=1)[:, None]
        inverse = 1 / (t[:, None] + squares)
        rate = inverse[:, :, None] * np.eye(3) - (scaled * inverse)[:, :, None] * slope[:, None, :]
        curvature = (rate - normal[:, :, None] * np.einsum("ni,nij->nj", normal, rate)[:, None, :]) / length[
            :, None, None
        ]
        return Gap(t * length, normal, curvature)

    def keeps(self, mirror: Mirror) -> bool:
        x, y, _ = self.semi_axes
        axis = np.round(self.turn[:, 0], 12)
        image = mirror.image(axis)
        along = np.array_equal(image, axis) or np.array_equal(image, -axis)
        return bool(self._keeps_tip(mirror) and (along or x == y))

    @cached_property
    def _hertz(self) -> tuple[float, float]:
        """Larger and smaller semi-axis of the contact ellipse, divided by the square root of the depth, in mm^(1/2)."""
        from scipy.optimize import brentq
        from scipy.special import ellipe, ellipk

        x, y, z = self.semi_axes
        flat, sharp = sorted((x**2 / z, y**2 / z), reverse=True)  # radii of curvature at the tip
        if sharp > (1 - ROUND) * flat:
            return math.sqrt(sharp), math.sqrt(sharp)

        # m is the squared eccentricity of the contact; the ratio of sharp to flat is that of the two integrals of m.
        def excess(m: float) -> float:
            return float((ellipk(m) - ellipe(m)) * flat - (ellipe(m) / (1 - m) - ellipk(m)) * sharp)

        m = brentq(excess, 0.1 * (1 - sharp / flat), 1 - 1e-15)
        larger = math.sqrt(2 * flat * (1 - ellipe(m) / ellipk(m)) / m)
        return larger, larger * math.sqrt(1 - m)

    def _contact(self, depth: float) -> tuple[float, float]:
        """Larger and smaller semi-axis in mm of the contact with a half-space at a depth in mm."""
        root = math.sqrt(min(depth, DEEPEST * float(self.semi_axes.min())))
        larger, smaller = self._hertz
        return larger * root, smaller * root

    def contact_radius(self, depth: float) -> float:
        """Smaller semi-axis of the elliptic contact, by Hertz."""
        return self._contact(depth)[1]

    def own_distance_to_steepest_pressure(self, points: np.ndarray, depth: float) -> np.ndarray:
        """Distances of points from the middle line of the elliptic contact: the segment of its major axis that ends one
        smaller semi-axis before the edge."""
        larger, smaller = self._contact(depth)
        along = 0 if self.semi_axes[0] >= self.semi_axes[1] else 1
        nearest = np.zeros_like(points)
        nearest[:, along] = np.clip(points[:, along], smaller - larger, larger - smaller)
        return np.linalg.norm(points - nearest, axis=1)

    @property
    def thickness(self) -> float:
        return 2 * float(self.semi_axes.min())

    @property
    def size_text(self) -> str:
        smallest = int(self.semi_axes.argmin())
        return f"indenter_semi_axis_{_AXES[smallest]} = {self.semi_axes[smallest]:g}"

    def own_surface(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        z, widest = float(self.semi_axes[2]), float(self.semi_axes[:2].max())
        largest_angle = math.pi if 2 * z <= reach else math.acos(1 - reach / z)
        if widest > reach:
            largest_angle = min(largest_angle, math.asin(reach / widest))
        angles = np.linspace(0, largest_angle, ALONG)
        outline = np.stack([np.sin(angles), 1 - np.cos(angles)], axis=1)
        vertices, triangles = revolved(np.append(outline, [[0, outline[-1, 1]]], axis=0))
        return vertices * self.semi_axes, triangles
