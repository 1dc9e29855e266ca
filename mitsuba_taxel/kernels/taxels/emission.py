"""Directional laws of an LED: the distribution of its power over the hemisphere in front of it.

Each law has a density per solid angle that integrates to 1, so that power is conserved. As in commercial ray tracers, a
*conical* release is uniform per solid angle, or in the polar angle.
"""

from __future__ import annotations

import math
from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.kernels.tables import Interpolant, find_cell, read_angular_table, refine
from mitsuba_taxel.specification.annular_led import AnnularLed


class EmissionLaw(Protocol):
    """Angular law of an LED: a probability density of directions, in a frame with the normal of the LED along +z."""

    def sample(self, sample: mi.Point2f) -> mi.Vector3f:
        """Sample a direction by a point of the unit square."""

    def density(self, direction: mi.Vector3f) -> mi.Float:
        """Probability per solid angle [1/sr] of a unit direction; 0 outside the law's support."""


class UniformSolidAngle:
    """Law of an LED whose light is uniform per solid angle within a cone: density 1 / (2 pi (1 - cos(cone_angle)))."""

    def __init__(self, cone_angle: float) -> None:
        self.cos_cutoff = dr.opaque(mi.Float, math.cos(math.radians(cone_angle)))

    def sample(self, sample: mi.Point2f) -> mi.Vector3f:
        return mi.warp.square_to_uniform_cone(sample, self.cos_cutoff)

    def density(self, direction: mi.Vector3f) -> mi.Float:
        inside = (direction.z >= self.cos_cutoff) & (direction.z > 0)
        return dr.select(inside, dr.inv_two_pi / (1 - self.cos_cutoff), 0)


class UniformPolarAngle:
    """Law of an LED whose polar angle is uniform in [0, cone_angle]: density 1 / (2 pi cone_angle sin(theta)),
    unbounded on the axis.
    """

    def __init__(self, cone_angle: float) -> None:
        self.cutoff = dr.opaque(mi.Float, math.radians(cone_angle))

    def sample(self, sample: mi.Point2f) -> mi.Vector3f:
        sin_theta, cos_theta = dr.sincos(sample.x * self.cutoff)
        return _direction(sin_theta, cos_theta, sample.y)

    def density(self, direction: mi.Vector3f) -> mi.Float:
        sin_theta = dr.sqrt(dr.square(direction.x) + dr.square(direction.y))
        inside = (dr.atan2(sin_theta, direction.z) <= self.cutoff) & (direction.z > 0) & (sin_theta > 0)
        return dr.select(inside, dr.inv_two_pi / (self.cutoff * sin_theta), 0)


class CosineLaw:
    """Law of an LED that emits by Lambert's cosine law over the whole hemisphere: density cos(theta) / pi."""

    def sample(self, sample: mi.Point2f) -> mi.Vector3f:
        return mi.warp.square_to_cosine_hemisphere(sample)

    def density(self, direction: mi.Vector3f) -> mi.Float:
        return dr.inv_pi * dr.maximum(direction.z, 0)


class CosinePower:
    """Law of an LED that emits as a power of the cosine over the hemisphere: density (exponent + 1) / (2 pi)
    cos(theta)**exponent; uniform for exponent 0.

    Narrow lobes need 1 - cos(theta), which loses its precision if computed from cos(theta). Hence 1 - exp(-x) = 2 t /
    (1 + t) with t = tanh(x / 2), and log(cos(theta)) = -2 atanh(tan(theta / 2)**2).
    """

    def __init__(self, exponent: float) -> None:
        self.exponent = dr.opaque(mi.Float, exponent)

    def sample(self, sample: mi.Point2f) -> mi.Vector3f:
        log_cos = dr.log(1 - sample.x) / (self.exponent + 1)
        t = dr.tanh(-0.5 * log_cos)
        return _direction(_sine(2 * t / (1 + t)), dr.exp(log_cos), sample.y)

    def density(self, direction: mi.Vector3f) -> mi.Float:
        z = direction.z
        squared_tangent = _one_minus_cosine(direction) / (1 + z)
        log_cos = dr.select(z > 0.5, -2 * dr.atanh(squared_tangent), dr.log(dr.maximum(z, 1e-30)))
        return dr.select(z > 0, dr.inv_two_pi * (self.exponent + 1) * dr.exp(self.exponent * log_cos), 0)


class Tabulated:
    """Law of an LED whose radiant intensity is given by a table: linear in the polar angle between its rows and zero
    beyond the last row.

    The table is refined to 4096 nodes that include all of its rows; for up to 2048 rows, neighbours differ by at most
    0.044 degrees. Between nodes, the intensity is linear in 1 - cos(theta). This intensity is sampled by inversion, and
    :meth:`density` returns it. It equals the intensity of the table at an angle with an error of at most 0.011 degrees
    near the axis, and of less than 0.0002 degrees above 2 degrees.

    Parameters
    ----------
    angles : (n,) ndarray
        Polar angles in degrees, strictly increasing from 0 to at most 90.
    intensities : (n,) ndarray
        Relative radiant intensities, not all 0.

    Attributes
    ----------
    table : tuple of (NODES,) ndarray
        Increasing cosines, and densities [1/sr], at the nodes.
    """

    def __init__(self, angles: np.ndarray, intensities: np.ndarray) -> None:
        angles, intensities = refine(angles, intensities / intensities.max())
        # Nodes are rounded to single precision first, so that sampling and density agree.
        nodes = (2 * np.sin(np.radians(angles) / 2) ** 2).astype(np.float32).astype(float)
        mass = np.diff(nodes) * (intensities[1:] + intensities[:-1]) / 2
        cumulative = np.concatenate([[0.0], np.cumsum(mass)])
        self.density_of_one_minus_cosine = Interpolant(nodes, intensities / cumulative[-1])
        self.table = 1 - nodes[::-1], intensities[::-1] / (2 * math.pi * cumulative[-1])
        self.cumulative = mi.Float(in_packets(cumulative / cumulative[-1]))

    def sample(self, sample: mi.Point2f) -> mi.Vector3f:
        cell = find_cell(self.cumulative, sample.x)
        (below, above), (lower, upper), (low, high) = (
            (dr.gather(mi.Float, table, cell), dr.gather(mi.Float, table, cell + 1))
            for table in (
                self.cumulative,
                self.density_of_one_minus_cosine.nodes,
                self.density_of_one_minus_cosine.values,
            )
        )
        fraction = (sample.x - below) / (above - below)
        # Root of low t + (high - low) t**2 / 2 = share (low + high) / 2, in a form without cancellation.
        divisor = low + dr.sqrt(dr.lerp(dr.square(low), dr.square(high), fraction))
        t = dr.select(divisor > 0, dr.minimum(fraction * (low + high) / divisor, 1), 0)
        one_minus_cosine = dr.lerp(lower, upper, t)
        return _direction(_sine(one_minus_cosine), 1 - one_minus_cosine, sample.y)

    def density(self, direction: mi.Vector3f) -> mi.Float:
        value = dr.inv_two_pi * self.density_of_one_minus_cosine(_one_minus_cosine(direction))
        return dr.select(direction.z > 0, value, 0)


def _direction(sin_theta: mi.Float, cos_theta: mi.Float, turn: mi.Float) -> mi.Vector3f:
    """Unit vector from the sine and cosine of its polar angle and from its azimuth, given as a fraction ``turn`` of a
    full turn."""
    sin_phi, cos_phi = dr.sincos(dr.two_pi * turn)
    return mi.Vector3f(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)


def _one_minus_cosine(direction: mi.Vector3f) -> mi.Float:
    """Value 1 - cos(theta) of a unit vector at the polar angle theta, without loss of digits near the axis."""
    return (dr.square(direction.x) + dr.square(direction.y)) / (1 + direction.z)


def _sine(one_minus_cosine: mi.Float) -> mi.Float:
    """Sine of an angle from one minus its cosine, without loss of digits near the axis."""
    return dr.sqrt(one_minus_cosine * (2 - one_minus_cosine))


def law_of(led: AnnularLed) -> EmissionLaw:
    """The emission law of an LED.

    Parameters
    ----------
    led : AnnularLed
        Parameters of the LED.

    Returns
    -------
    EmissionLaw
        Density and sampling of directions.

    Raises
    ------
    InputError
        if the table of the law is not allowed.
    """
    if led.cone_angle is not None:
        cone = UniformSolidAngle if led.law == "uniform_solid_angle" else UniformPolarAngle
        return cone(led.cone_angle)
    if led.exponent is not None:
        return CosinePower(led.exponent)
    return CosineLaw() if led.file is None else Tabulated(*read_angular_table(led.file))
