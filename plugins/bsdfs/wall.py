"""A wall of a cell or a plate: mirror, Lambertian, isotropic or absorbing."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.parameters import choice, number

SCATTERING = ("mirror", "lambertian", "isotropic", "absorbing")


class Wall(mi.BSDF):
    r"""
    .. _bsdf-wall:

    Wall (:monosp:`wall`)
    ---------------------

    .. pluginparameters::

     * - scattering
       - |string|
       - :monosp:`mirror`, :monosp:`lambertian` (cosine law), :monosp:`isotropic` (equal probability per solid
         angle) or :monosp:`absorbing`. (Default: :monosp:`lambertian`)

     * - reflectance
       - |float|
       - Share of the light that comes back, 0 to 1; not for :monosp:`absorbing`. (Default: 1)

    An opaque surface that does the same on both sides. The isotropic wall is not reciprocal: light that comes in
    from any direction leaves uniformly over the hemisphere, f = reflectance / (2 pi cos(theta_o)). Traced from the
    light its weight is constant; traced from a detector it carries 1 / (2 cos(theta)), which has no bounded variance.

    .. tabs::
        .. code-tab:: xml

            <bsdf type="wall">
                <string name="scattering" value="isotropic"/> <float name="reflectance" value="0.9"/>
            </bsdf>

        .. code-tab:: python

            'type': 'wall', 'scattering': 'isotropic', 'reflectance': 0.9
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.scattering = choice(props, "scattering", "lambertian", SCATTERING)
        if self.scattering == "absorbing" and "reflectance" in props:
            raise InputError("reflectance is not allowed for scattering = 'absorbing', which reflects nothing.")
        reflectance = 0.0
        if self.scattering != "absorbing":
            reflectance = number(props, "reflectance", 1.0, minimum=0, maximum=1)
        self.reflectance = dr.opaque(mi.Float, reflectance)
        self.m_flags = self._flags()
        self.m_components = [self.m_flags]

    def _flags(self) -> int:
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        if self.scattering == "mirror":
            return +mi.BSDFFlags.DeltaReflection | sides
        if self.scattering == "absorbing":
            return +mi.BSDFFlags.Empty | sides
        return +mi.BSDFFlags.DiffuseReflection | sides

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        cos_in = dr.abs(si.wi.z)
        active = mi.Bool(active) & (cos_in > 0)
        bs.eta = 1
        if self.scattering == "absorbing":
            return bs, mi.Spectrum(0)
        bs.sampled_type = mi.UInt32(self.m_flags)
        if self.scattering == "mirror":
            bs.wo = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
            bs.pdf = dr.select(active, 1, 0)
            return bs, mi.Spectrum(self.reflectance) & active
        uniform = self._uniform(ctx)
        square_to = mi.warp.square_to_uniform_hemisphere if uniform else mi.warp.square_to_cosine_hemisphere
        bs.wo = square_to(sample2)
        cos_out = bs.wo.z
        bs.pdf = dr.select(active, dr.inv_two_pi if uniform else dr.inv_pi * cos_out, 0)
        bs.wo.z = dr.mulsign(cos_out, si.wi.z)
        weight = mi.Float(self.reflectance)
        if self.scattering == "isotropic" and not uniform:
            weight /= 2 * cos_in
        return bs, mi.Spectrum(weight) & (active & (bs.pdf > 0))

    def eval(self, ctx, si, wo, active=True):
        cos_in, cos_out, active = self._cosines(si, wo, active)
        if self.scattering == "lambertian":
            value = dr.inv_pi * cos_out
        elif self.scattering == "isotropic":
            value = mi.Float(dr.inv_two_pi) if self._uniform(ctx) else dr.inv_two_pi * cos_out / cos_in
        else:
            return mi.Spectrum(0)
        return mi.Spectrum(self.reflectance * value) & active

    def pdf(self, ctx, si, wo, active=True):
        _, cos_out, active = self._cosines(si, wo, active)
        if self.scattering in ("mirror", "absorbing"):
            return mi.Float(0)
        density = mi.Float(dr.inv_two_pi) if self._uniform(ctx) else dr.inv_pi * cos_out
        return dr.select(active, density, 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def _uniform(self, ctx: mi.BSDFContext) -> bool:
        """Whether directions are drawn uniformly: only an isotropic wall met by light does so."""
        return self.scattering == "isotropic" and ctx.mode == mi.TransportMode.Importance

    @staticmethod
    def _cosines(si, wo, active):
        return dr.abs(si.wi.z), dr.abs(wo.z), mi.Bool(active) & (si.wi.z * wo.z > 0)

    def traverse(self, callback) -> None:
        callback.put("reflectance", self.reflectance, +mi.ParamFlags.Differentiable)

    def to_string(self) -> str:
        return f"Wall[scattering = {self.scattering}, reflectance = {self.reflectance[0]:g}]"
