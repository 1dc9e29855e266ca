"""A wall of a cell or a plate: mirror, rough mirror, Lambertian, isotropic, a mixture of these, or absorbing."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.surfaces.reflectance import ReflectanceTable
from mitsuba_taxel.kernels.surfaces.scattering import (
    Absorbing,
    Isotropic,
    Lambertian,
    Mixed,
    RoughMirror,
    Scattering,
    SmoothMirror,
)
from mitsuba_taxel.specification.wall import Wall as Parameters
from mitsuba_taxel.specification.wall_materials import WALL_MATERIALS, WallMaterial


class Wall(mi.BSDF):
    r"""
    .. _bsdf-wall:

    Wall (:monosp:`wall`)
    ---------------------

    This BSDF describes an opaque two-sided surface. Light that is not reflected is absorbed.

    The isotropic wall is not reciprocal: light from any direction leaves uniformly over the hemisphere,
    f = reflectance / (2 pi cos(theta_o)). Traced from the light, its weight is constant; traced from a detector, its
    weight is 1 / (2 cos(theta)), whose variance is infinite. The same applies to the isotropic fraction of a mixed
    wall.

    The rough mirror has facets whose slopes along x and along y are Gaussian, each with the root mean square
    tan(rms_slope): this is Beckmann's distribution with alpha = sqrt(2) tan(rms_slope). Facets shadow each other
    (Smith), and light that would meet a second facet is lost. Such a wall reflects less than its reflectance, and much
    less at slopes around 45 degrees.

    A table of reflectance is interpolated linearly at the wavelength of the LEDs. The functions and commands of
    mitsuba_taxel set that wavelength before they render. The same holds for a measured material; a material without
    data at that wavelength is refused. The page on measured walls has their values and sources.

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
        self.specification = parameters = Parameters.read(props)
        self.scattering = parameters.scattering
        self.law = _law_of(parameters)
        self.table = _table_of(parameters)
        self.reflectance = None if self.table else dr.opaque(mi.Float, parameters.reflectance or 0.0)
        self.is_directed = self.scattering in ("mirror", "rough_mirror", "mixed")
        self.m_components = self.law.components
        self.m_flags = 0
        for flags in self.law.components:
            self.m_flags |= flags

    @property
    def needs_wavelength(self) -> bool:
        """Whether the reflectance is undefined until :meth:`set_wavelength` is called."""
        return self.table is not None

    def set_wavelength(self, nm: float) -> None:
        """Set the reflectance to the value of the table at the wavelength of the LEDs.

        Parameters
        ----------
        nm : float
            Wavelength in nm.

        Raises
        ------
        InputError
            if the table does not cover that wavelength.
        """
        assert self.table is not None
        self.reflectance = dr.opaque(mi.Float, self.table.at(nm))

    def sample(self, ctx, si, sample1, sample2, active=True):
        drawn = self.law.sample(_above(si.wi), sample1, sample2, _from_light(ctx))
        active = mi.Bool(active) & (si.wi.z != 0) & (drawn.density > 0)

        # The law samples on the front; the direction is on the side of incidence.
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = mi.Vector3f(drawn.direction.x, drawn.direction.y, dr.mulsign(drawn.direction.z, si.wi.z))
        bs.eta = 1
        bs.sampled_component = mi.UInt32(drawn.component)
        for i, flags in enumerate(self.law.components):
            bs.sampled_type = dr.select(bs.sampled_component == i, flags, bs.sampled_type)

        # Where the normal of the wall differs from that of the triangle, directions behind the triangle are mirrored,
        # and density and value are sums over both directions.
        density, weight = drawn.density, drawn.weight
        if self.is_directed:
            mirrored, behind = _mirrored(si, bs.wo)
            bs.wo = dr.select(behind, mirrored, bs.wo)
            if self.scattering != "mirror":
                value, total = self._of_both_sides(ctx, si, bs.wo)
                specular = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
                density = dr.select(specular, density, total)
                weight = dr.select(specular, weight, dr.select(total > 0, value / total, 0))
        bs.pdf = dr.select(active, density, 0)
        return bs, mi.Spectrum(self._known_reflectance() * weight) & active

    def eval(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx, si, wo, active=True):
        value, density = (self._of_both_sides if self.is_directed else self._of_one_side)(ctx, si, wo)
        active = mi.Bool(active)
        return mi.Spectrum(self._known_reflectance() * value) & active, dr.select(active, density, 0)

    def _of_one_side(self, ctx, si, wo):
        """Value and probability density of scattering into the direction ``wo``; zero if it is not on the side of
        incidence."""
        value, density = self.law.eval_pdf(_above(si.wi), _above(wo), _from_light(ctx))
        same = si.wi.z * wo.z > 0
        return dr.select(same, value, 0), dr.select(same, density, 0)

    def _of_both_sides(self, ctx, si, wo):
        """Value and probability density of scattering into the direction ``wo``. Light that would leave behind the
        triangle is mirrored by it and included."""
        value, density = self._of_one_side(ctx, si, wo)
        mirrored, behind = _mirrored(si, wo)
        mirrored_value, mirrored_density = self._of_one_side(ctx, si, mirrored)
        _, from_behind = _mirrored(si, mirrored)
        return (
            dr.select(behind, 0, value) + dr.select(from_behind, mirrored_value, 0),
            dr.select(behind, 0, density) + dr.select(from_behind, mirrored_density, 0),
        )

    def eval_diffuse_reflectance(self, si, active=True):
        """Fraction of the light that is reflected, except specular reflection."""
        return mi.Spectrum(self._known_reflectance() * self.law.smooth_fraction()) & mi.Bool(active)

    def _known_reflectance(self) -> mi.Float:
        """The reflectance; raises `InputError` if a table has no wavelength yet."""
        if self.reflectance is None:
            assert self.table is not None
            raise InputError(
                f"wall: {self.table.parameter} needs the wavelength of the LEDs, which only mitsuba_taxel sets: use "
                "measure or taxel render."
            )
        return self.reflectance

    def traverse(self, callback) -> None:
        if self.reflectance is not None:
            callback.put("reflectance", self.reflectance, +mi.ParamFlags.Differentiable)

    def to_string(self) -> str:
        reflectance = "not known yet" if self.reflectance is None else f"{self.reflectance[0]:g}"
        return f"Wall[scattering = {self.scattering}, reflectance = {reflectance}]"


def _table_of(parameters: Parameters) -> ReflectanceTable | WallMaterial | None:
    """Reflectance against wavelength, from a file or of a measured material; None for a number."""
    if parameters.material is not None:
        return WALL_MATERIALS[parameters.material]
    return None if parameters.reflectance_table is None else ReflectanceTable(parameters.reflectance_table)


def _law_of(parameters: Parameters) -> Scattering:
    """The scattering law of a wall."""
    fractions = [
        fraction
        for fraction in (parameters.specular, parameters.lambertian, parameters.isotropic)
        if fraction is not None
    ]
    if fractions:
        return Mixed(*fractions)
    if parameters.rms_slope is not None:
        return RoughMirror(parameters.rms_slope)
    laws: dict[str, type[Scattering]] = {
        "mirror": SmoothMirror,
        "lambertian": Lambertian,
        "isotropic": Isotropic,
        "absorbing": Absorbing,
    }
    return laws[parameters.scattering]()


def _mirrored(si: mi.SurfaceInteraction3f, wo: mi.Vector3f) -> tuple[mi.Vector3f, mi.Bool]:
    """A direction mirrored by the plane of the triangle, and whether the direction passes through the triangle.

    The latter occurs only where the normal of the wall differs from that of the triangle.
    """
    normal = si.to_local(si.n)
    height = dr.dot(wo, normal)
    return wo - 2 * height * normal, height * dr.dot(si.wi, normal) < 0


def _above(direction: mi.Vector3f) -> mi.Vector3f:
    """Direction mirrored to the front of the wall if it points behind the wall, else unchanged."""
    return mi.Vector3f(direction.x, direction.y, dr.abs(direction.z))


def _from_light(ctx: mi.BSDFContext) -> bool:
    """Whether paths are traced from the light, rather than from the detector."""
    return ctx.mode == mi.TransportMode.Importance
