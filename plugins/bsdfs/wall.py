"""A wall of a cell or a plate: mirror, rough mirror, Lambertian, isotropic, a mixture of them, or absorbing."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.parameters import choice, number
from mitsuba_taxel.kernels.reflectance import ReflectanceTable
from mitsuba_taxel.kernels.scattering import Absorbing, Isotropic, Lambertian, Mirror, Mixed, RoughMirror, Scattering

SCATTERING = ("mirror", "lambertian", "isotropic", "absorbing", "mixed", "rough_mirror")
SMALLEST_SLOPE = 0.01
"""Least rms slope in degrees: Mitsuba widens what is below 0.004 (its alpha is at least 1e-4), and rounding blurs
slopes by some 1e-7 / cos(theta)."""

_ONLY_FOR = {"rms_slope": "rough_mirror", "specular": "mixed", "lambertian": "mixed", "isotropic": "mixed"}


class Wall(mi.BSDF):
    r"""
    .. _bsdf-wall:

    Wall (:monosp:`wall`)
    ---------------------

    .. pluginparameters::

     * - scattering
       - |string|
       - :monosp:`mirror`, :monosp:`lambertian` (cosine law), :monosp:`isotropic` (equal probability per solid
         angle), :monosp:`absorbing`, :monosp:`mixed` or :monosp:`rough_mirror`. (Default: :monosp:`lambertian`)

     * - reflectance
       - |float|
       - Share of the light that comes back, 0 to 1; not for :monosp:`absorbing`. (Default: 1)

     * - reflectance_table
       - |string|
       - Instead of :monosp:`reflectance`: a CSV file of wavelength in nm, increasing, and reflectance, 0 to 1.
         (Default: none)

     * - specular, lambertian, isotropic
       - |float|
       - For :monosp:`mixed`: how much of the reflected light each law gets, 0 to 1; together they make 1.
         (Default: 0, 0, 0)

     * - rms_slope
       - |float|
       - For :monosp:`rough_mirror`: angle whose tangent is the root mean square slope along either axis of the wall
         (not of both together), in degrees, from 0.01 to 45.

    An opaque surface that does the same on both sides. What is not reflected is absorbed. The isotropic wall is not
    reciprocal: light that comes in from any direction leaves uniformly over the hemisphere,
    f = reflectance / (2 pi cos(theta_o)). Traced from the light its weight is constant; traced from a detector it
    carries 1 / (2 cos(theta)), which has no bounded variance. The same holds for the isotropic share of a mixed wall.

    The rough mirror has facets whose slopes along x and along y are Gaussian, each with the root mean square
    tan(rms_slope): Beckmann's distribution with alpha = sqrt(2) tan(rms_slope). Facets hide each other (Smith), and
    light that would meet a second facet is lost: such a wall returns less than its reflectance, and much less if it is
    as rough as 45 degrees.

    A table is interpolated linearly at the wavelength of the LEDs, which whoever measures must first set; measuring
    through mitsuba_taxel does so.

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
        for name, owner in _ONLY_FOR.items():
            if name in props and self.scattering != owner:
                raise InputError(f"{name} is not allowed for scattering = {self.scattering!r}, only for {owner!r}.")
        self.law = self._read_law(props)
        self.table: ReflectanceTable | None = None
        self.reflectance: mi.Float | None = None
        self._read_reflectance(props)
        self.is_directed = self.scattering in ("mirror", "rough_mirror", "mixed")
        self.m_components = self.law.components
        self.m_flags = 0
        for flags in self.law.components:
            self.m_flags |= flags

    def _read_law(self, props: mi.Properties) -> Scattering:
        if self.scattering == "mixed":
            return Mixed(*_read_shares(props))
        if self.scattering == "rough_mirror":
            return RoughMirror(_read_slope(props))
        laws: dict[str, type[Scattering]] = {
            "mirror": Mirror,
            "lambertian": Lambertian,
            "isotropic": Isotropic,
            "absorbing": Absorbing,
        }
        return laws[self.scattering]()

    def _read_reflectance(self, props: mi.Properties) -> None:
        given = [name for name in ("reflectance", "reflectance_table") if name in props]
        if self.scattering == "absorbing" and given:
            raise InputError(f"{given[0]} is not allowed for scattering = 'absorbing', which reflects nothing.")
        if len(given) == 2:
            raise InputError("reflectance and reflectance_table exclude each other: one of them is needed.")
        if given == ["reflectance_table"]:
            self.table = ReflectanceTable(props.get("reflectance_table"))
        elif self.scattering == "absorbing":
            self.reflectance = dr.opaque(mi.Float, 0.0)
        else:
            self.reflectance = dr.opaque(mi.Float, number(props, "reflectance", 1.0, minimum=0, maximum=1))

    @property
    def needs_wavelength(self) -> bool:
        """Whether the reflectance is known only once :meth:`set_wavelength` has been called."""
        return self.table is not None

    def set_wavelength(self, nm: float) -> None:
        """Take the reflectance at a wavelength in nm from the table of a wall that has one.

        Raises
        ------
        InputError
            if the table does not reach that wavelength.
        """
        assert self.table is not None
        self.reflectance = dr.opaque(mi.Float, self.table.at(nm))

    def sample(self, ctx, si, sample1, sample2, active=True):
        drawn = self.law.sample(_above(si.wi), sample1, sample2, _from_light(ctx))
        active = mi.Bool(active) & (si.wi.z != 0) & (drawn.density > 0)
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = mi.Vector3f(drawn.direction.x, drawn.direction.y, dr.mulsign(drawn.direction.z, si.wi.z))
        bs.eta = 1
        bs.sampled_component = mi.UInt32(drawn.component)
        for i, flags in enumerate(self.law.components):
            bs.sampled_type = dr.select(bs.sampled_component == i, flags, bs.sampled_type)
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
        """Value and density of what leaves in direction ``wo`` from the side on which the light comes in."""
        value, density = self.law.eval_pdf(_above(si.wi), _above(wo), _from_light(ctx))
        same = si.wi.z * wo.z > 0
        return dr.select(same, value, 0), dr.select(same, density, 0)

    def _of_both_sides(self, ctx, si, wo):
        """As :meth:`_of_one_side`, with what would leave behind the triangle, mirrored by it."""
        value, density = self._of_one_side(ctx, si, wo)
        mirrored, behind = _mirrored(si, wo)
        more, denser = self._of_one_side(ctx, si, mirrored)
        _, back = _mirrored(si, mirrored)
        return (
            dr.select(behind, 0, value) + dr.select(back, more, 0),
            dr.select(behind, 0, density) + dr.select(back, denser, 0),
        )

    def eval_diffuse_reflectance(self, si, active=True):
        """Share of the light that comes back otherwise than from a mirror."""
        return mi.Spectrum(self._known_reflectance() * self.law.smooth_share()) & mi.Bool(active)

    def _known_reflectance(self) -> mi.Float:
        if self.reflectance is None:
            raise InputError(
                "wall: reflectance_table needs the wavelength of the LEDs, which measuring through mitsuba_taxel sets."
            )
        return self.reflectance

    def traverse(self, callback) -> None:
        if self.reflectance is not None:
            callback.put("reflectance", self.reflectance, +mi.ParamFlags.Differentiable)

    def to_string(self) -> str:
        reflectance = "not known yet" if self.reflectance is None else f"{self.reflectance[0]:g}"
        return f"Wall[scattering = {self.scattering}, reflectance = {reflectance}]"


def _read_shares(props: mi.Properties) -> tuple[float, float, float]:
    specular = number(props, "specular", 0.0, minimum=0, maximum=1)
    lambertian = number(props, "lambertian", 0.0, minimum=0, maximum=1)
    isotropic = number(props, "isotropic", 0.0, minimum=0, maximum=1)
    total = specular + lambertian + isotropic
    if abs(total - 1) > 1e-6:
        raise InputError(
            f"specular = {specular:g}, lambertian = {lambertian:g}, isotropic = {isotropic:g} are not allowed: "
            f"their sum is {total:.8g} and must be 1, as they share the reflected light."
        )
    return specular, lambertian, isotropic


def _read_slope(props: mi.Properties) -> float:
    slope = number(props, "rms_slope", above=0, maximum=45)
    if slope < SMALLEST_SLOPE:
        raise InputError(
            f"rms_slope = {slope:g} is not allowed: at least {SMALLEST_SLOPE:g} degrees is needed; "
            "use scattering = 'mirror' for less."
        )
    return slope


def _mirrored(si: mi.SurfaceInteraction3f, wo: mi.Vector3f) -> tuple[mi.Vector3f, mi.Bool]:
    """A direction mirrored by the plane of the triangle, and whether the light, coming in before it, left behind it.

    Both may be where the normal of the wall is not that of the triangle. On flat walls nothing leaves behind it.
    """
    normal = si.to_local(si.n)
    height = dr.dot(wo, normal)
    return wo - 2 * height * normal, height * dr.dot(si.wi, normal) < 0


def _above(direction: mi.Vector3f) -> mi.Vector3f:
    """The direction, mirrored to the front of the wall if it is behind."""
    return mi.Vector3f(direction.x, direction.y, dr.abs(direction.z))


def _from_light(ctx: mi.BSDFContext) -> bool:
    return ctx.mode == mi.TransportMode.Importance
