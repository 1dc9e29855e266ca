"""A BSDF for each region of a pad or a photo-reflector."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.surfaces.regions import ALL_REGIONS, COAT_REGIONS
from mitsuba_taxel.specification.region import Region as Parameters


class Region(mi.BSDF):
    r"""
    .. _bsdf-region:

    Wall by region (:monosp:`region`)
    ---------------------------------

    This BSDF selects one of its nested BSDFs by the face attribute :monosp:`face_region` of the mesh. The codes are
    roof = 1, side = 2, bottom = 3, top = 4, outer = 5, body = 6, led = 7, phototransistor = 8. A `deformable_pad`, the
    PLY files written from it and a `photo_reflector` have that attribute. Regions without a BSDF and other codes
    absorb. The regions of a pad without cells have names of their own: coat is the top, window the bottom, and side the
    outer faces. These names and the others exclude each other, except that side alone is that of cells.

    .. tabs::
        .. code-tab:: xml

            <bsdf type="region">
                <bsdf name="roof" type="wall"> <string name="scattering" value="isotropic"/> </bsdf>
                <bsdf name="side" type="wall"> <string name="scattering" value="absorbing"/> </bsdf>
            </bsdf>

        .. code-tab:: python

            'type': 'region', 'roof': {'type': 'wall', 'scattering': 'isotropic'}
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.walls = {}
        nested = dict(props.objects())
        known = {name: name for name in ALL_REGIONS}
        if "coat" in nested or "window" in nested:
            known = COAT_REGIONS
        self.without_cells = known is COAT_REGIONS
        for name, value in nested.items():
            if name not in known:
                others = "" if self.without_cells else ", or coat, window and side for a pad without cells"
                beside = " beside coat or window" if name in ALL_REGIONS else ""
                raise InputError(f"region: {name!r} is not a region{beside}: allowed are {', '.join(known)}{others}.")
            if not isinstance(value, mi.BSDF):
                raise InputError(f"region: {name} is not allowed: a nested BSDF is needed.")
            self.walls[known[name]] = value
        if not self.walls:
            raise InputError(f"region: it has no BSDF: at least one of {', '.join(ALL_REGIONS)} is needed.")
        self.specification = Parameters.read(props)
        components = [int(wall.flags(i)) for wall in self.walls.values() for i in range(wall.component_count())]
        self.m_components = components
        self.m_flags = 0
        for flag in components:
            self.m_flags |= flag

    @property
    def needs_wavelength(self) -> bool:
        """Whether any nested `wall` has a table of reflectance, and so needs the wavelength."""
        return bool(self._walls_with_table())

    def set_wavelength(self, nm: float) -> None:
        """Set the wavelength of the LEDs in the walls that need it.

        Parameters
        ----------
        nm : float
            Wavelength in nm.

        Raises
        ------
        InputError
            if the table of a wall does not cover that wavelength.
        """
        for wall in self._walls_with_table():
            wall.set_wavelength(nm)

    def _walls_with_table(self) -> list[mi.BSDF]:
        return [wall for wall in self.walls.values() if getattr(wall, "needs_wavelength", False)]

    def _walls_hit(self, si, active):
        """Iterate over the nested BSDFs, each with the mask of the lanes of ``active`` whose hit lies in its region."""
        code = si.shape.eval_attribute_1("face_region", si, active)
        for name, wall in self.walls.items():
            yield wall, mi.Bool(active) & (dr.abs(code - ALL_REGIONS[name]) < 0.5)

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs, weight = dr.zeros(mi.BSDFSample3f), mi.Spectrum(0)
        for wall, inside in self._walls_hit(si, active):
            wall_bs, wall_weight = wall.sample(ctx, si, sample1, sample2, inside)
            bs = dr.select(inside, wall_bs, bs)
            weight = dr.select(inside, wall_weight, weight)
        return bs, weight

    def eval(self, ctx, si, wo, active=True):
        value = mi.Spectrum(0)
        for wall, inside in self._walls_hit(si, active):
            value = dr.select(inside, wall.eval(ctx, si, wo, inside), value)
        return value

    def pdf(self, ctx, si, wo, active=True):
        density = mi.Float(0)
        for wall, inside in self._walls_hit(si, active):
            density = dr.select(inside, wall.pdf(ctx, si, wo, inside), density)
        return density

    def eval_pdf(self, ctx, si, wo, active=True):
        value, density = mi.Spectrum(0), mi.Float(0)
        for wall, inside in self._walls_hit(si, active):
            wall_value, wall_density = wall.eval_pdf(ctx, si, wo, inside)
            value = dr.select(inside, wall_value, value)
            density = dr.select(inside, wall_density, density)
        return value, density

    def eval_diffuse_reflectance(self, si, active=True):
        reflectance = mi.Spectrum(0)
        for wall, inside in self._walls_hit(si, active):
            reflectance = dr.select(inside, wall.eval_diffuse_reflectance(si, inside), reflectance)
        return reflectance

    def traverse(self, callback) -> None:
        for name, wall in self.walls.items():
            callback.put(name, wall, +mi.ParamFlags.Differentiable)

    def to_string(self) -> str:
        return f"Region[{', '.join(self.walls)}]"
