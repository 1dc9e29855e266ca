"""Scattering laws of walls, per unit of reflectance.

Directions are unit vectors in the local frame of the wall, with z along its normal and positive. ``from_light`` is
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
"""Least cosine of incidence: Mitsuba's sampling of normals divides by the cosine, which gives NaN at 0."""


class Sample(NamedTuple):
    """A direction sampled by a scattering law: the direction; its density [1/sr], or its probability for a mirror; the
    value of the law divided by the density; and the component of the law.
    """

    direction: mi.Vector3f
    density: mi.Float
    weight: mi.Float
    component: mi.UInt32 | int = 0


class Scattering(Protocol):
    """Base class of the scattering laws of a wall. ``components`` are the flags of its components in Mitsuba."""

    components: list[int]

    def sample(self, wi: mi.Vector3f, sample1: mi.Float, sample2: mi.Point2f, from_light: bool) -> Sample:
        """Sample a direction by three uniform random numbers; see :class:`Sample`. The direction ``wi`` points back
        along the path. For ``from_light``, see the top of this module."""

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f, from_light: bool) -> tuple[mi.Float, mi.Float]:
        """Value f |cos(theta_o)| [1/sr] and density [1/sr] of a direction, both without delta components."""

    def smooth_fraction(self) -> mi.Float | float:
        """Fraction of the reflected light that is not specular."""


class Absorbing:
    """Scattering law of an absorbing wall: no light is scattered."""

    def __init__(self) -> None:
        self.components = [+mi.BSDFFlags.Empty | _BOTH_SIDES]

    def sample(self, wi, sample1, sample2, from_light) -> Sample:
        return Sample(dr.zeros(mi.Vector3f), mi.Float(0), mi.Float(0))

    def eval_pdf(self, wi, wo, from_light):
        return mi.Float(0), mi.Float(0)

    def smooth_fraction(self):
        return 0.0


class SmoothMirror:
    """Scattering law of a smooth mirror."""

    def __init__(self) -> None:
        self.components = [+mi.BSDFFlags.DeltaReflection | _BOTH_SIDES]

    def sample(self, wi, sample1, sample2, from_light) -> Sample:
        return Sample(mi.Vector3f(-wi.x, -wi.y, wi.z), mi.Float(1), mi.Float(1))

    def eval_pdf(self, wi, wo, from_light):
        return mi.Float(0), mi.Float(0)

    def smooth_fraction(self):
        return 0.0


class Lambertian:
    """Scattering law of a Lambertian wall: the cosine law, f = 1 / pi."""

    def __init__(self) -> None:
        self.components = [+mi.BSDFFlags.DiffuseReflection | _BOTH_SIDES]

    def sample(self, wi, sample1, sample2, from_light) -> Sample:
        wo = mi.warp.square_to_cosine_hemisphere(sample2)
        return Sample(wo, dr.inv_pi * wo.z, mi.Float(1))

    def eval_pdf(self, wi, wo, from_light):
        value = dr.inv_pi * wo.z
        return value, value

    def smooth_fraction(self):
        return 1.0


class Isotropic:
    """Scattering law of an isotropic wall: equal power into equal solid angles for every direction of incidence, f = 1
    / (2 pi cos(theta_o)).

    The law is not reciprocal. For paths from a detector the directions are exchanged, f = 1 / (2 pi cos(theta_i)). They
    are sampled by the cosine law, with the weight 1 / (2 cos(theta_i)).
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

    def smooth_fraction(self):
        return 1.0


class Mixed:
    """Scattering law of a mixture of mirror, Lambertian and isotropic wall, each with a given fraction of the reflected
    light.

    Components are sampled in proportion to their fractions. The density of a non-specular direction is the sum of both
    non-specular components, so that from the light every weight is 1.
    """

    DRJIT_STRUCT: ClassVar = {"fractions": list}  # variables of recorded kernels

    def __init__(self, specular: float, lambertian: float, isotropic: float) -> None:
        self.mirror, self.lambertian, self.isotropic = SmoothMirror(), Lambertian(), Isotropic()
        total = specular + lambertian + isotropic
        fractions = (specular / total, lambertian / total, isotropic / total)
        self.fractions = [dr.opaque(mi.Float, fraction) for fraction in fractions]
        self.components = [self.mirror.components[0], self.lambertian.components[0]]

    def sample(self, wi, sample1, sample2, from_light) -> Sample:
        specular, lambertian, _ = self.fractions
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
        _, lambertian, isotropic = self.fractions
        by_cosine, cosine_density = self.lambertian.eval_pdf(wi, wo, from_light)
        uniform, uniform_density = self.isotropic.eval_pdf(wi, wo, from_light)
        value = lambertian * by_cosine + isotropic * uniform
        return value, lambertian * cosine_density + isotropic * uniform_density

    def smooth_fraction(self):
        return self.fractions[1] + self.fractions[2]


class RoughMirror:
    """Scattering law of a rough mirror: perfectly conducting facets with Gaussian slopes (Beckmann's distribution),
    Smith's shadowing, one reflection.

    f = D(h) G1(wi) G1(wo) / (4 cos(theta_i) cos(theta_o)), alpha = sqrt(2) times the root mean square slope along
    either axis (B. Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007, equations 20 and
    25; their G1 through the closed form with erf, of which their equation 27 is a fit). Visible normals are sampled (E.
    Heitz, E. d'Eon, Importance Sampling Microfacet-Based BSDFs using the Distribution of Visible Normals, EGSR 2014),
    which leaves the weight G1(wo).
    """

    DRJIT_STRUCT: ClassVar = {"alpha": float}  # variables of recorded kernels

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

    def smooth_fraction(self):
        return 1.0

    def _normals(self) -> mi.MicrofacetDistribution:
        return mi.MicrofacetDistribution(mi.MicrofacetType.Beckmann, self.alpha, True)

    def _density(self, wi: mi.Vector3f, normal: mi.Vector3f) -> mi.Float:
        """Density [1/sr] of the reflection of ``wi`` at a facet that is sampled among the visible facets."""
        return self._normals().eval(normal) * self._visible(wi) / (4 * wi.z)

    def _visible(self, direction: mi.Vector3f) -> mi.Float:
        """Smith's G1: fraction of the facets towards ``direction`` that are not hidden by other facets."""
        a = direction.z / (self.alpha * dr.sqrt(dr.square(direction.x) + dr.square(direction.y)))
        return 2 / (1 + dr.erf(a) + dr.exp(-dr.square(a)) * dr.rsqrt(dr.pi) / a)
