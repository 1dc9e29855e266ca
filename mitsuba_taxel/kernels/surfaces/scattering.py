"""Scattering laws of walls, per unit of reflectance.

Directions are unit vectors in the local frame of the wall, with z along its normal, both above it. ``from_light`` is
the direction of tracing: from the light a path carries power, from a detector radiance. Only non-reciprocal laws differ
between the two.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple, Protocol

import drjit as dr
import mitsuba as mi

_BOTH_SIDES = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
_SMALLEST_COSINE = 1e-7
"""Mitsuba's sampling of normals divides by the cosine of incidence, which gives NaN at 0."""


class Sample(NamedTuple):
    """A sampled direction, its density [1/sr] (a probability for a mirror), value over density, and the component."""

    direction: mi.Vector3f
    density: mi.Float
    weight: mi.Float
    component: mi.UInt32 | int = 0


class Scattering(Protocol):
    """A law; ``components`` are Mitsuba's flags of its components."""

    components: list[int]

    def sample(self, wi: mi.Vector3f, sample1: mi.Float, sample2: mi.Point2f, from_light: bool) -> Sample:
        """A direction for three uniform numbers."""

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f, from_light: bool) -> tuple[mi.Float, mi.Float]:
        """Value f |cos(theta_o)| [1/sr] and density [1/sr] of a direction, both without delta components."""

    def smooth_share(self) -> mi.Float | float:
        """Share of the reflected light that is not specular."""


class Absorbing:
    """Nothing is reflected."""

    def __init__(self) -> None:
        self.components = [+mi.BSDFFlags.Empty | _BOTH_SIDES]

    def sample(self, wi, sample1, sample2, from_light) -> Sample:
        return Sample(dr.zeros(mi.Vector3f), mi.Float(0), mi.Float(0))

    def eval_pdf(self, wi, wo, from_light):
        return mi.Float(0), mi.Float(0)

    def smooth_share(self):
        return 0.0


class SmoothMirror:
    """A smooth mirror."""

    def __init__(self) -> None:
        self.components = [+mi.BSDFFlags.DeltaReflection | _BOTH_SIDES]

    def sample(self, wi, sample1, sample2, from_light) -> Sample:
        return Sample(mi.Vector3f(-wi.x, -wi.y, wi.z), mi.Float(1), mi.Float(1))

    def eval_pdf(self, wi, wo, from_light):
        return mi.Float(0), mi.Float(0)

    def smooth_share(self):
        return 0.0


class Lambertian:
    """Lambert's cosine law: f = 1 / pi."""

    def __init__(self) -> None:
        self.components = [+mi.BSDFFlags.DiffuseReflection | _BOTH_SIDES]

    def sample(self, wi, sample1, sample2, from_light) -> Sample:
        wo = mi.warp.square_to_cosine_hemisphere(sample2)
        return Sample(wo, dr.inv_pi * wo.z, mi.Float(1))

    def eval_pdf(self, wi, wo, from_light):
        value = dr.inv_pi * wo.z
        return value, value

    def smooth_share(self):
        return 1.0


class Isotropic:
    """Equal power into equal solid angles, whatever the direction of incidence: f = 1 / (2 pi cos(theta_o)).

    Not reciprocal. From a detector the roles are exchanged, f = 1 / (2 pi cos(theta_i)); directions are then sampled by
    the cosine law, with the weight 1 / (2 cos(theta_i)).
    """

    def __init__(self) -> None:
        self.components = [+mi.BSDFFlags.DiffuseReflection | _BOTH_SIDES]

    def sample(self, wi, sample1, sample2, from_light) -> Sample:
        if from_light:
            return Sample(mi.warp.square_to_uniform_hemisphere(sample2), mi.Float(dr.inv_two_pi), mi.Float(1))
        wo = mi.warp.square_to_cosine_hemisphere(sample2)
        return Sample(wo, dr.inv_pi * wo.z, 0.5 / wi.z)

    def eval_pdf(self, wi, wo, from_light):
        if from_light:
            return mi.Float(dr.inv_two_pi), mi.Float(dr.inv_two_pi)
        return dr.inv_two_pi * wo.z / wi.z, dr.inv_pi * wo.z

    def smooth_share(self):
        return 1.0


class Mixed:
    """A mixture of mirror, Lambertian and isotropic wall, each with its share of the reflected light.

    Each is sampled in proportion to its share; a smooth direction has the density of both smooth components together,
    so that from the light every weight is 1.
    """

    DRJIT_STRUCT: ClassVar = {"shares": list}  # for recorded kernels

    def __init__(self, specular: float, lambertian: float, isotropic: float) -> None:
        self.mirror, self.lambertian, self.isotropic = SmoothMirror(), Lambertian(), Isotropic()
        total = specular + lambertian + isotropic
        shares = (specular / total, lambertian / total, isotropic / total)
        self.shares = [dr.opaque(mi.Float, share) for share in shares]
        self.components = [self.mirror.components[0], self.lambertian.components[0]]

    def sample(self, wi, sample1, sample2, from_light) -> Sample:
        specular, lambertian, _ = self.shares
        mirrored = self.mirror.sample(wi, sample1, sample2, from_light)
        by_cosine = self.lambertian.sample(wi, sample1, sample2, from_light)
        isotropic = self.isotropic.sample(wi, sample1, sample2, from_light)
        smooth = dr.select(sample1 < specular + lambertian, by_cosine.direction, isotropic.direction)
        value, density = self.eval_pdf(wi, smooth, from_light)
        is_mirror = sample1 < specular
        return Sample(
            dr.select(is_mirror, mirrored.direction, smooth),
            dr.select(is_mirror, specular, density),
            dr.select(is_mirror, 1, value / density),
            dr.select(is_mirror, mi.UInt32(0), mi.UInt32(1)),
        )

    def eval_pdf(self, wi, wo, from_light):
        _, lambertian, isotropic = self.shares
        by_cosine, cosine_density = self.lambertian.eval_pdf(wi, wo, from_light)
        uniform, uniform_density = self.isotropic.eval_pdf(wi, wo, from_light)
        value = lambertian * by_cosine + isotropic * uniform
        return value, lambertian * cosine_density + isotropic * uniform_density

    def smooth_share(self):
        return self.shares[1] + self.shares[2]


class RoughMirror:
    """Perfectly conducting facets with Gaussian slopes: Beckmann's distribution, Smith's shadowing, one reflection.

    f = D(h) G1(wi) G1(wo) / (4 cos(theta_i) cos(theta_o)), alpha = sqrt(2) times the root mean square slope along
    either axis (B. Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007, equations 20 and
    25; their G1 through the closed form with erf, of which their equation 27 is a fit). Visible normals are sampled (E.
    Heitz, E. d'Eon, Importance Sampling Microfacet-Based BSDFs using the Distribution of Visible Normals, EGSR 2014),
    which leaves the weight G1(wo).
    """

    DRJIT_STRUCT: ClassVar = {"alpha": float}  # for recorded kernels

    def __init__(self, rms_slope: float) -> None:
        self.components = [+mi.BSDFFlags.GlossyReflection | _BOTH_SIDES]
        self.alpha = dr.opaque(mi.Float, math.sqrt(2) * math.tan(math.radians(rms_slope)))

    def sample(self, wi, sample1, sample2, from_light) -> Sample:
        wi = mi.Vector3f(wi.x, wi.y, dr.maximum(wi.z, _SMALLEST_COSINE))
        normal, _ = self._normals().sample(wi, sample2)
        wo = mi.reflect(wi, normal)
        density = dr.select(wo.z > 0, self._density(wi, normal), 0)
        return Sample(wo, density, self._visible(wo))

    def eval_pdf(self, wi, wo, from_light):
        density = self._density(wi, dr.normalize(wi + wo))
        return density * self._visible(wo), density

    def smooth_share(self):
        return 1.0

    def _normals(self) -> mi.MicrofacetDistribution:
        return mi.MicrofacetDistribution(mi.MicrofacetType.Beckmann, self.alpha, True)

    def _density(self, wi: mi.Vector3f, normal: mi.Vector3f) -> mi.Float:
        """Density of the reflection of ``wi`` at a facet sampled among the visible ones."""
        return self._normals().eval(normal) * self._visible(wi) / (4 * wi.z)

    def _visible(self, direction: mi.Vector3f) -> mi.Float:
        """Smith's G1: share of the facets towards ``direction`` that are not hidden by others."""
        a = direction.z / (self.alpha * dr.sqrt(dr.square(direction.x) + dr.square(direction.y)))
        return 2 / (1 + dr.erf(a) + dr.exp(-dr.square(a)) * dr.rsqrt(dr.pi) / a)
