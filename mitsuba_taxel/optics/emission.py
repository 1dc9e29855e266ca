"""Directional laws of an LED: how its power is spread over the hemisphere in front of it.

Each law has a density per solid angle that integrates to 1, so that the power is conserved under every law.
The words are those of commercial ray tracers: a *conical* release is uniform per solid angle, or spaces the polar
angle uniformly.
"""

from __future__ import annotations

import math
from typing import Protocol

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.optics.parameters import choice, number

LAWS = ("uniform_solid_angle", "uniform_polar_angle", "lambertian")


class EmissionLaw(Protocol):
    """A probability density over directions, given in the frame in which the LED faces +z."""

    def sample(self, sample: mi.Point2f) -> mi.Vector3f:
        """A direction for a point of the unit square."""

    def density(self, direction: mi.Vector3f) -> mi.Float:
        """Probability per solid angle [1/sr] of a unit direction; 0 outside the law's support."""


class UniformSolidAngle:
    """Uniform per solid angle within a cone: density 1 / (2 pi (1 - cos(cone_angle)))."""

    def __init__(self, cone_angle: float) -> None:
        self.cos_cutoff = dr.opaque(mi.Float, math.cos(math.radians(cone_angle)))

    def sample(self, sample: mi.Point2f) -> mi.Vector3f:
        return mi.warp.square_to_uniform_cone(sample, self.cos_cutoff)

    def density(self, direction: mi.Vector3f) -> mi.Float:
        inside = (direction.z >= self.cos_cutoff) & (direction.z > 0)
        return dr.select(inside, dr.inv_two_pi / (1 - self.cos_cutoff), 0)


class UniformPolarAngle:
    """Polar angle uniform in [0, cone_angle]: density 1 / (2 pi cone_angle sin(theta)), unbounded on the axis."""

    def __init__(self, cone_angle: float) -> None:
        self.cutoff = dr.opaque(mi.Float, math.radians(cone_angle))

    def sample(self, sample: mi.Point2f) -> mi.Vector3f:
        sin_theta, cos_theta = dr.sincos(sample.x * self.cutoff)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * sample.y)
        return mi.Vector3f(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)

    def density(self, direction: mi.Vector3f) -> mi.Float:
        sin_theta = dr.sqrt(dr.square(direction.x) + dr.square(direction.y))
        inside = (dr.atan2(sin_theta, direction.z) <= self.cutoff) & (direction.z > 0) & (sin_theta > 0)
        return dr.select(inside, dr.inv_two_pi / (self.cutoff * sin_theta), 0)


class Lambertian:
    """Lambert's cosine law over the whole hemisphere: density cos(theta) / pi."""

    def sample(self, sample: mi.Point2f) -> mi.Vector3f:
        return mi.warp.square_to_cosine_hemisphere(sample)

    def density(self, direction: mi.Vector3f) -> mi.Float:
        return dr.inv_pi * dr.maximum(direction.z, 0)


def read_law(props: mi.Properties) -> EmissionLaw:
    """The law that the parameters ``law`` and, for the cones, ``cone_angle`` (degrees) describe."""
    law = choice(props, "law", "uniform_solid_angle", LAWS)
    if law == "lambertian":
        return Lambertian()
    cone_angle = number(props, "cone_angle", 88.0, above=0, maximum=90)
    return UniformSolidAngle(cone_angle) if law == "uniform_solid_angle" else UniformPolarAngle(cone_angle)
