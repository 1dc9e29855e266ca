"""A square or round LED with a dark centre, in a single narrow band."""

from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.carriers import faces_on, window_on
from mitsuba_taxel.kernels.taxels.emission import Tabulated, law_of
from mitsuba_taxel.kernels.taxels.faces import FaceGrid
from mitsuba_taxel.kernels.taxels.windows import Window, transmittance
from mitsuba_taxel.specification.annular_led import AnnularLed as Parameters


class AnnularLed(mi.Emitter):
    r"""
    .. _emitter-annular_led:

    Annular LED (:monosp:`annular_led`)
    -----------------------------------

    Nest this emitter in a `rectangle`, at whose centre it lies, or in a `photo_reflector`, where it is repeated in
    every package. Under every law, each LED emits exactly :monosp:`power`, uniformly over its emitting area. The power
    is a number of watts, the same in each colour channel; power and wavelength are not subject to colour conversion.
    The name of a table file is relative to the scene's XML file.

    Ray tracers call the cone laws *conical* release (the polar angle of equations 2 to 4 in
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
        self.specification = Parameters.read(props)
        self.wavelength = self.specification.wavelength
        self.law = law_of(self.specification)
        self.table = self.law.table if isinstance(self.law, Tabulated) else None
        self.power = dr.opaque(mi.Float, self.specification.power)
        self.resin_index: mi.Float | None = None
        self._faces: FaceGrid | None = None
        self.m_flags = +mi.EmitterFlags.Surface | +mi.EmitterFlags.SpatiallyVarying

    # Interface of `taxel_tracer`: one LED at a time

    @property
    def faces(self) -> FaceGrid:
        """Positions of the LEDs, computed at first use: the emitter gets its shape after its construction."""
        if self._faces is None:
            parameters = self.specification
            self._faces = faces_on(self.get_shape(), "led", (parameters.size, parameters.size))
            outer, inner = (0.5 * self._faces.scale * side for side in (parameters.size, parameters.hole))
            self._annulus = _ANNULI[parameters.shape](outer, inner)
            self._window = window_on(self.get_shape(), "led", self._faces)
        return self._faces

    @property
    def window(self) -> Window:
        """The windows above the LEDs."""
        assert self.faces  # computes the windows as well
        return self._window

    def sample_point(self, index: mi.UInt32, sample: mi.Point2f) -> mi.Point3f:
        """A uniformly distributed point on the emitting annulus of LED ``index``."""
        faces = self.faces
        return faces.point(index, self._annulus.sample(sample))

    def sample_direction_of_emission(self, sample: mi.Point2f) -> mi.Vector3f:
        """A direction in world coordinates, distributed by the law."""
        return self.faces.frame.to_world(self.law.sample(sample))

    def density_of_direction(self, d: mi.Vector3f) -> mi.Float:
        """Density [1/sr] of :meth:`sample_direction_of_emission` at the world direction ``d``."""
        return self.law.density(self.faces.frame.to_local(d))

    def emitted_fraction(self, d: mi.Vector3f) -> mi.Float:
        """Fraction of the power per solid angle [1/sr] that leaves an open window in world direction ``d``."""
        return self.density_of_direction(d) * self._passed(dr.dot(d, self.faces.frame.n))

    def leave(self, index: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point3f, mi.Float]:
        """Point at which a ray from the point ``p`` of LED ``index`` leaves its window, and the fraction of its power
        that leaves; ``d`` is the world direction in air."""
        exit_point, is_open = self.window.leave(index, p, d)
        return exit_point, self._passed(dr.dot(d, self.faces.frame.n)) & is_open

    def _passed(self, cosine: mi.Float) -> mi.Float:
        """Radiance in air divided by the radiance in the resin below the window, for a cosine of the angle in air."""
        if self.resin_index is None:
            return mi.Float(1)
        return transmittance(self.resin_index, cosine) / dr.square(self.resin_index)

    @property
    def area(self) -> mi.Float:
        """Emitting area of each LED [mm²]."""
        assert self.faces  # computes the annulus as well
        return self._annulus.area

    def contains(self, index: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> mi.Bool:
        """Whether a ray in direction ``d`` through the surface point ``p`` meets the emitting annulus of LED
        ``index``."""
        offset, enters = self.window.enter(index, p, d)
        return enters & self._annulus.contains(offset)

    def _lit(self, p: mi.Point3f, d: mi.Vector3f) -> mi.Bool:
        """Whether light leaves the surface point ``p`` in world direction ``d``."""
        return self.contains(self.window.faces.locate(p)[0], p, -d) if self._is_nested else mi.Bool(False)

    def _radiance(self, d: mi.Vector3f) -> mi.Spectrum:
        """Radiance [W/(mm² sr)] that leaves each lit point in world direction ``d``."""
        if not self._is_nested:
            return mi.Spectrum(0)
        cosine = dr.dot(d, self.faces.frame.n)
        value = self.power / self._annulus.area * self.emitted_fraction(d) / cosine
        return mi.Spectrum(dr.select(cosine > 0, value, 0))

    # Interface of the integrators of Mitsuba: all LEDs together. Dr.Jit records these calls for every LED object that
    # exists, even without a surface or in another scene; such an LED emits nothing.

    @property
    def _is_nested(self) -> bool:
        """Whether the LED has a shape, which is not accessed once positions are known: it may be deleted by then."""
        return self._faces is not None or self.get_shape() is not None

    @property
    def _density(self) -> mi.Float:
        """Density [1/mm²] of the points of `sample_position`."""
        return dr.rcp(self.faces.count * self._annulus.area) if self._is_nested else mi.Float(0)

    def eval(self, si, active=True):
        d = si.to_world(si.wi)
        return self._radiance(d) & self._lit(si.p, d) & active

    def sample_position(self, time, sample, active=True):
        ps, _ = self._sample_position(time, sample)
        return ps, dr.select(active, dr.rcp(ps.pdf), 0) if self._is_nested else mi.Float(0)

    def _sample_position(self, time, sample):
        """A point of an LED, and the index of that LED."""
        ps = dr.zeros(mi.PositionSample3f)
        if not self._is_nested:
            return ps, mi.UInt32(0)
        index, reused = _pick(sample.x, self.faces.count)
        ps.p = self.sample_point(index, mi.Point2f(reused, sample.y))
        ps.n = self.faces.frame.n
        ps.time = time
        ps.pdf = self._density
        return ps, index

    def pdf_position(self, ps, active=True):
        if not self._is_nested:
            return mi.Float(0)
        on_die = self.faces.is_at_height(ps.p) & self._annulus.contains(self.faces.locate(ps.p)[1])
        return dr.select(on_die & active, self._density, 0)

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        if not self._is_nested:
            return dr.zeros(mi.Ray3f), mi.Spectrum(0)
        ps, index = self._sample_position(time, sample2)
        d = self.sample_direction_of_emission(sample3)
        ps.p, passed = self.leave(index, ps.p, d)
        si = mi.SurfaceInteraction3f(ps, dr.zeros(mi.Color0f))
        return si.spawn_ray(d), mi.Spectrum(self.faces.count * self.power * passed) & active

    def sample_direction(self, it, sample, active=True):
        if not self._is_nested:
            return dr.zeros(mi.DirectionSample3f), mi.Spectrum(0)
        ps, index = self._sample_position(it.time, sample)
        sight = self.window.sight(index, it.p, ps.p)
        ds = mi.DirectionSample3f(ps)
        ds.p, ds.d, ds.dist = sight.crossing, sight.direction, dr.norm(sight.crossing - it.p)
        cos_theta = -dr.dot(ds.d, ds.n)
        active &= (cos_theta > 0) & sight.is_open
        ds.pdf = dr.select(active, ps.pdf * sight.squared_distance / cos_theta, 0)
        ds.emitter = mi.EmitterPtr(self)
        return ds, dr.select(active, self._radiance(-ds.d) / ds.pdf, 0)

    def pdf_direction(self, it, ds, active=True):
        if not self._is_nested:
            return mi.Float(0)
        cos_theta = -dr.dot(ds.d, ds.n)
        active &= (cos_theta > 0) & self._lit(ds.p, -ds.d)
        return dr.select(active, self.window.apparent(dr.square(ds.dist), cos_theta) / cos_theta * self._density, 0)

    def eval_direction(self, it, ds, active=True):
        return self._radiance(-ds.d) & self._lit(ds.p, -ds.d) & active

    def sample_wavelengths(self, si, sample, active=True):
        return dr.zeros(mi.Color0f), self.eval(si, active)

    def bbox(self):
        return self.get_shape().bbox()

    def traverse(self, callback) -> None:
        callback.put("power", self.power, +mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys=()) -> None:
        self._faces = None  # the rectangle that carries it may have been moved

    def to_string(self) -> str:
        size = f"{self.specification.shape}, size = {self.specification.size:g}, hole = {self.specification.hole:g}"
        return f"AnnularLed[power = {self.power[0]:g} W at {self.wavelength:g} nm, {size}]"


class _SquareAnnulus:
    """The area between two concentric squares of half-sides ``inner`` and ``outer``."""

    def __init__(self, outer: float, inner: float) -> None:
        self.outer, self.inner = dr.opaque(mi.Float, outer), dr.opaque(mi.Float, inner)
        self.area = dr.opaque(mi.Float, 4 * (outer**2 - inner**2))

    def sample(self, sample: mi.Point2f) -> mi.Point2f:
        half = dr.sqrt(dr.lerp(dr.square(self.inner), dr.square(self.outer), sample.x))
        perimeter = 4 * sample.y
        edge = dr.minimum(dr.floor(perimeter), 3)
        position = 2 * (perimeter - edge) - 1
        x = dr.select(edge == 0, 1, dr.select(edge == 2, -1, dr.select(edge == 1, -position, position)))
        y = dr.select(edge == 1, 1, dr.select(edge == 3, -1, dr.select(edge == 0, position, -position)))
        return mi.Point2f(half * x, half * y)

    def contains(self, offset: mi.Point2f) -> mi.Bool:
        half = dr.maximum(dr.abs(offset.x), dr.abs(offset.y))
        return (half <= self.outer) & (half >= self.inner)


class _CircularAnnulus:
    """The area between two concentric circles of radii ``inner`` and ``outer``."""

    def __init__(self, outer: float, inner: float) -> None:
        self.outer, self.inner = dr.opaque(mi.Float, outer), dr.opaque(mi.Float, inner)
        self.area = dr.opaque(mi.Float, math.pi * (outer**2 - inner**2))

    def sample(self, sample: mi.Point2f) -> mi.Point2f:
        radius = dr.sqrt(dr.lerp(dr.square(self.inner), dr.square(self.outer), sample.x))
        sin_phi, cos_phi = dr.sincos(dr.two_pi * sample.y)
        return mi.Point2f(radius * cos_phi, radius * sin_phi)

    def contains(self, offset: mi.Point2f) -> mi.Bool:
        radius = dr.norm(offset)
        return (radius <= self.outer) & (radius >= self.inner)


_ANNULI: dict[str, type[_SquareAnnulus] | type[_CircularAnnulus]] = {
    "square": _SquareAnnulus,
    "circular": _CircularAnnulus,
}
"""The emitting area of an LED around its centre, in world lengths.

Both outlines map the unit square continuously and with equal areas, which preserves low discrepancy: the first
coordinate runs from the hole to the outer edge, the second around the centre.
"""


def _pick(sample: mi.Float, count: int) -> tuple[mi.UInt32, mi.Float]:
    """Choose an index uniformly from [0, count) by a random number, and rescale the rest of the number to [0, 1)."""
    scaled = sample * count
    index = dr.minimum(mi.UInt32(scaled), count - 1)
    return index, scaled - mi.Float(index)
