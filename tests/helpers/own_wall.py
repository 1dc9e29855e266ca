"""A wall that a user has written: a Lambertian one of a share of the light."""

from __future__ import annotations

from pathlib import Path

PLUGIN = """
import drjit as dr
import mitsuba as mi


class Darkened(mi.BSDF):
    def __init__(self, props):
        super().__init__(props)
        self.share = dr.opaque(mi.Float, props.get("share", 1.0))
        self.m_components = [+mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = mi.warp.square_to_cosine_hemisphere(sample2)
        bs.pdf = self.pdf(ctx, si, bs.wo, active)
        bs.eta = 1.0
        bs.sampled_type = +mi.BSDFFlags.DiffuseReflection
        bs.sampled_component = 0
        return bs, mi.Spectrum(self.share) & (active & (mi.Frame3f.cos_theta(si.wi) > 0))

    def eval(self, ctx, si, wo, active=True):
        lit = active & (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        return mi.Spectrum(self.share * dr.inv_pi * mi.Frame3f.cos_theta(wo)) & lit

    def pdf(self, ctx, si, wo, active=True):
        return dr.select(active & (mi.Frame3f.cos_theta(wo) > 0), dr.inv_pi * mi.Frame3f.cos_theta(wo), 0)

    def to_string(self):
        return "Darkened[]"


mi.register_bsdf("NAME", Darkened)
"""
PLATE_OF_ONES_OWN = """<scene version="3.9.0">
    <default name="share" value="1"/>
    <integrator type="taxel_tracer"/>
    <shape type="rectangle">
        <transform name="to_world"><rotate x="1" angle="180"/><scale value="3"/><translate z="1.5"/></transform>
        <bsdf type="{}"> <float name="share" value="$share"/> </bsdf>
    </shape>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
</scene>
"""


def darkened_wall(file: Path) -> Path:
    """Write the plugin of the file's name, without its suffix."""
    file.write_text(PLUGIN.replace("NAME", file.stem))
    return file
