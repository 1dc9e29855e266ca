"""A square LED with a dark centre, in one narrow band."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.emission import read_law
from mitsuba_taxel.optics.faces import FaceGrid, faces_on
from mitsuba_taxel.optics.parameters import number


class AnnularLed(mi.Emitter):
    r"""
    .. _emitter-annular_led:

    Annular LED (:monosp:`annular_led`)
    -----------------------------------

    .. pluginparameters::

     * - power
       - |float|
       - Power that one LED emits, in W. (Default: 1)

     * - size
       - |float|
       - Side of the emitting square, in mm. (Default: 0.25)

     * - hole
       - |float|
       - Side of the dark square at its centre, in mm; 0 for a full square. (Default: 0.1)

     * - law
       - |string|
       - Directional law: :monosp:`uniform_solid_angle` (a cone, uniform per solid angle),
         :monosp:`uniform_polar_angle` (a cone, uniform in the polar angle) or :monosp:`lambertian`.
         (Default: :monosp:`uniform_solid_angle`)

     * - cone_angle
       - |float|
       - Half-angle of the cone against the normal, in degrees, for the two cone laws only. (Default: 88)

    Nest it in a `rectangle`, which it lights from the centre of, or in a `photo_reflector`, of which it lights
    every LED. The power is a plain number of watts, the same in each colour channel; it never passes through
    colour conversion. Under every law exactly :monosp:`power` leaves each LED.

    The cone laws are those that ray tracers call *conical* release (the polar angle of equations 2 to 4 in
    Multiphysics Simulation for the Optimization of an Optoelectronic-Based Tactile Sensor).

    .. tabs::
        .. code-tab:: xml

            <shape type="rectangle">
                <emitter type="annular_led"> <string name="law" value="lambertian"/> </emitter>
            </shape>

        .. code-tab:: python

            'type': 'annular_led', 'law': 'lambertian'
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        power = number(props, "power", 1.0, minimum=0)
        self.side = number(props, "size", 0.25, above=0)
        self.hole_side = number(props, "hole", 0.1, minimum=0)
        if self.hole_side >= self.side:
            raise InputError(
                f"hole = {self.hole_side:g} is not allowed: a number below size = {self.side:g} is needed."
            )
        self.law = read_law(props)
        self.power = dr.opaque(mi.Float, power)
        self._faces: FaceGrid | None = None
        self.m_flags = +mi.EmitterFlags.Surface | +mi.EmitterFlags.SpatiallyVarying

    # What `taxel_tracer` asks: one LED at a time

    @property
    def faces(self) -> FaceGrid:
        """Where the LEDs are; found when first asked for, since the shape adopts its emitter late."""
        if self._faces is None:
            self._faces = faces_on(self.get_shape(), "led", (self.side, self.side))
            outer, inner = (0.5 * self._faces.scale * side for side in (self.side, self.hole_side))
            self._outer = dr.opaque(mi.Float, outer)
            self._inner = dr.opaque(mi.Float, inner)
            self._area = dr.opaque(mi.Float, 4 * (outer**2 - inner**2))
        return self._faces

    def sample_point(self, index: mi.UInt32, sample: mi.Point2f) -> mi.Point3f:
        """A point uniform on the emitting annulus of LED ``index``."""
        faces = self.faces
        return faces.point(index, self._square_annulus(sample))

    def sample_direction_of_emission(self, sample: mi.Point2f) -> mi.Vector3f:
        """A world direction distributed as the law says."""
        return self.faces.frame.to_world(self.law.sample(sample))

    def density_of_direction(self, d: mi.Vector3f) -> mi.Float:
        """Share of the power per solid angle [1/sr] in world direction ``d``."""
        return self.law.density(self.faces.frame.to_local(d))

    def _square_annulus(self, sample: mi.Point2f) -> mi.Point2f:
        """Area-preserving map of the unit square: first to a concentric square, then along its perimeter."""
        half = dr.sqrt(dr.lerp(dr.square(self._inner), dr.square(self._outer), sample.x))
        perimeter = 4 * sample.y
        edge = dr.minimum(dr.floor(perimeter), 3)
        along = 2 * (perimeter - edge) - 1
        x = dr.select(edge == 0, 1, dr.select(edge == 2, -1, dr.select(edge == 1, -along, along)))
        y = dr.select(edge == 1, 1, dr.select(edge == 3, -1, dr.select(edge == 0, along, -along)))
        return mi.Point2f(half * x, half * y)

    def _lit(self, p: mi.Point3f) -> mi.Bool:
        _, offset = self.faces.locate(p)
        height = dr.abs(self.faces.frame.to_local(p - self.faces.origin).z)
        half = dr.maximum(dr.abs(offset.x), dr.abs(offset.y))
        return (half <= self._outer) & (half >= self._inner) & (height <= 1e-3 * self._outer)

    def _radiance(self, p: mi.Point3f, d: mi.Vector3f) -> mi.Spectrum:
        local = self.faces.frame.to_local(d)
        lit = self._lit(p) & (local.z > 0)
        value = self.power / self._area * self.law.density(local) / local.z
        return mi.Spectrum(dr.select(lit, value, 0))

    # What Mitsuba's own integrators ask: all LEDs together

    def eval(self, si, active=True):
        return self._radiance(si.p, si.to_world(si.wi)) & active

    def sample_position(self, time, sample, active=True):
        faces = self.faces
        index, reused = _pick(sample.x, faces.count)
        ps = dr.zeros(mi.PositionSample3f)
        ps.p = self.sample_point(index, mi.Point2f(reused, sample.y))
        ps.n = faces.frame.n
        ps.time = time
        ps.pdf = dr.rcp(faces.count * self._area)
        return ps, dr.select(active, faces.count * self._area, 0)

    def pdf_position(self, ps, active=True):
        return dr.select(self._lit(ps.p) & active, dr.rcp(self.faces.count * self._area), 0)

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        ps, _ = self.sample_position(time, sample2, active)
        si = mi.SurfaceInteraction3f(ps, dr.zeros(mi.Color0f))
        ray = si.spawn_ray(self.sample_direction_of_emission(sample3))
        return ray, mi.Spectrum(self.faces.count * self.power) & active

    def sample_direction(self, it, sample, active=True):
        ps, _ = self.sample_position(it.time, sample, active)
        ds = mi.DirectionSample3f(ps)
        ds.d = ps.p - it.p
        distance_squared = dr.squared_norm(ds.d)
        ds.dist = dr.sqrt(distance_squared)
        ds.d /= ds.dist
        cos_theta = -dr.dot(ds.d, ds.n)
        active &= cos_theta > 0
        ds.pdf = dr.select(active, ps.pdf * distance_squared / cos_theta, 0)
        ds.emitter = mi.EmitterPtr(self)
        radiance = self._radiance(ps.p, -ds.d)
        return ds, dr.select(active, radiance / ds.pdf, 0)

    def pdf_direction(self, it, ds, active=True):
        cos_theta = -dr.dot(ds.d, ds.n)
        active &= (cos_theta > 0) & self._lit(ds.p)
        return dr.select(active, dr.square(ds.dist) / (cos_theta * self.faces.count * self._area), 0)

    def eval_direction(self, it, ds, active=True):
        return self._radiance(ds.p, -ds.d) & active

    def sample_wavelengths(self, si, sample, active=True):
        return dr.zeros(mi.Color0f), self._radiance(si.p, si.to_world(si.wi)) & active

    def bbox(self):
        return self.get_shape().bbox()

    def traverse(self, callback) -> None:
        callback.put("power", self.power, +mi.ParamFlags.Differentiable)

    def to_string(self) -> str:
        return f"AnnularLed[power = {self.power[0]:g} W, size = {self.side:g}, hole = {self.hole_side:g}]"


def _pick(sample: mi.Float, count: int) -> tuple[mi.UInt32, mi.Float]:
    """An index uniform in [0, count) and the rest of the sample, stretched to [0, 1)."""
    scaled = sample * count
    index = dr.minimum(mi.UInt32(scaled), count - 1)
    return index, scaled - mi.Float(index)
