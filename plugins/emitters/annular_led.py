"""A square or round LED with a dark centre, in one narrow band."""

from __future__ import annotations

import math
from typing import Protocol

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.emission import law_of
from mitsuba_taxel.kernels.faces import FaceGrid, faces_on
from mitsuba_taxel.specification.annular_led import AnnularLed as Parameters


class AnnularLed(mi.Emitter):
    r"""
    .. _emitter-annular_led:

    Annular LED (:monosp:`annular_led`)
    -----------------------------------

    Nest it in a `rectangle`, at whose centre it lies, or in a `photo_reflector`, where it is repeated in every package.
    The power is a plain number of watts, the same in each colour channel; neither it nor the wavelength passes through
    colour conversion. Under every law each LED emits exactly :monosp:`power`, uniformly over its emitting area. A table
    beside the scene's XML file is found by its name.

    The cone laws are called *conical* release in ray tracers (the polar angle of equations 2 to 4 in
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
        self.power = dr.opaque(mi.Float, self.specification.power)
        self._faces: FaceGrid | None = None
        self.m_flags = +mi.EmitterFlags.Surface | +mi.EmitterFlags.SpatiallyVarying

    # Interface of `taxel_tracer`: one LED at a time

    @property
    def faces(self) -> FaceGrid:
        """Positions of the LEDs; computed on first use, since the emitter gets its shape late."""
        if self._faces is None:
            stated = self.specification
            self._faces = faces_on(self.get_shape(), "led", (stated.size, stated.size))
            outer, inner = (0.5 * self._faces.scale * side for side in (stated.size, stated.hole))
            self._annulus = _ANNULI[stated.shape](outer, inner)
        return self._faces

    def sample_point(self, index: mi.UInt32, sample: mi.Point2f) -> mi.Point3f:
        """A point uniform on the emitting annulus of LED ``index``."""
        faces = self.faces
        return faces.point(index, self._annulus.sample(sample))

    def sample_direction_of_emission(self, sample: mi.Point2f) -> mi.Vector3f:
        """A world direction sampled from the law."""
        return self.faces.frame.to_world(self.law.sample(sample))

    def density_of_direction(self, d: mi.Vector3f) -> mi.Float:
        """Share of the power per solid angle [1/sr] in world direction ``d``."""
        return self.law.density(self.faces.frame.to_local(d))

    @property
    def area(self) -> mi.Float:
        """Emitting area of one LED [mm²]."""
        assert self.faces  # computes the annulus as well
        return self._annulus.area

    def contains(self, index: mi.UInt32, p: mi.Point3f) -> mi.Bool:
        """Whether the surface point ``p`` lies on the emitting annulus of LED ``index``."""
        nearest, _ = self.faces.locate(p)
        return self._lit(p) & (nearest == index)

    def _lit(self, p: mi.Point3f) -> mi.Bool:
        if not self._is_nested:
            return mi.Bool(False)
        _, offset = self.faces.locate(p)
        height = dr.abs(self.faces.frame.to_local(p - self.faces.origin).z)
        return self._annulus.contains(offset) & (height <= 1e-3 * self._annulus.outer)

    def _radiance(self, d: mi.Vector3f) -> mi.Spectrum:
        """Radiance [W/(mm² sr)] that leaves each lit point in world direction ``d``."""
        if not self._is_nested:
            return mi.Spectrum(0)
        local = self.faces.frame.to_local(d)
        value = self.power / self._annulus.area * self.law.density(local) / local.z
        return mi.Spectrum(dr.select(local.z > 0, value, 0))

    # Interface of Mitsuba's own integrators: all LEDs together. Dr.Jit records such calls for every LED object that
    # exists, even without a surface or in another scene; such an LED emits nothing.

    @property
    def _is_nested(self) -> bool:
        return self._faces is not None or self.get_shape() is not None  # without access to a deleted shape

    @property
    def _density(self) -> mi.Float:
        """Density [1/mm²] of the points of `sample_position`."""
        return dr.rcp(self.faces.count * self._annulus.area) if self._is_nested else mi.Float(0)

    def eval(self, si, active=True):
        return self._radiance(si.to_world(si.wi)) & self._lit(si.p) & active

    def sample_position(self, time, sample, active=True):
        if not self._is_nested:
            return dr.zeros(mi.PositionSample3f), mi.Float(0)
        faces = self.faces
        index, reused = _pick(sample.x, faces.count)
        ps = dr.zeros(mi.PositionSample3f)
        ps.p = self.sample_point(index, mi.Point2f(reused, sample.y))
        ps.n = faces.frame.n
        ps.time = time
        ps.pdf = self._density
        return ps, dr.select(active, faces.count * self._annulus.area, 0)

    def pdf_position(self, ps, active=True):
        return dr.select(self._lit(ps.p) & active, self._density, 0)

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        if not self._is_nested:
            return dr.zeros(mi.Ray3f), mi.Spectrum(0)
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
        return ds, dr.select(active, self._radiance(-ds.d) / ds.pdf, 0)

    def pdf_direction(self, it, ds, active=True):
        cos_theta = -dr.dot(ds.d, ds.n)
        active &= (cos_theta > 0) & self._lit(ds.p)
        return dr.select(active, dr.square(ds.dist) / cos_theta * self._density, 0)

    def eval_direction(self, it, ds, active=True):
        return self._radiance(-ds.d) & self._lit(ds.p) & active

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


class _Annulus(Protocol):
    """The emitting area of one LED about its centre, in world lengths.

    Both outlines map the unit square continuously and with equal areas, which preserves low discrepancy: the first
    coordinate runs from the hole to the rim, the second once round.
    """

    outer: mi.Float
    area: mi.Float

    def sample(self, sample: mi.Point2f) -> mi.Point2f:
        """A point uniform on the area for a point uniform on the unit square."""

    def contains(self, offset: mi.Point2f) -> mi.Bool:
        """Whether a point lies on the area."""


class _SquareAnnulus:
    """Between two concentric squares of half-sides ``inner`` and ``outer``."""

    def __init__(self, outer: float, inner: float) -> None:
        self.outer, self.inner = dr.opaque(mi.Float, outer), dr.opaque(mi.Float, inner)
        self.area = dr.opaque(mi.Float, 4 * (outer**2 - inner**2))

    def sample(self, sample: mi.Point2f) -> mi.Point2f:
        half = dr.sqrt(dr.lerp(dr.square(self.inner), dr.square(self.outer), sample.x))
        perimeter = 4 * sample.y
        edge = dr.minimum(dr.floor(perimeter), 3)
        along = 2 * (perimeter - edge) - 1
        x = dr.select(edge == 0, 1, dr.select(edge == 2, -1, dr.select(edge == 1, -along, along)))
        y = dr.select(edge == 1, 1, dr.select(edge == 3, -1, dr.select(edge == 0, along, -along)))
        return mi.Point2f(half * x, half * y)

    def contains(self, offset: mi.Point2f) -> mi.Bool:
        half = dr.maximum(dr.abs(offset.x), dr.abs(offset.y))
        return (half <= self.outer) & (half >= self.inner)


class _CircularAnnulus:
    """Between two concentric circles of radii ``inner`` and ``outer``."""

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


def _pick(sample: mi.Float, count: int) -> tuple[mi.UInt32, mi.Float]:
    """An index uniform in [0, count) and the rest of the sample, rescaled to [0, 1)."""
    scaled = sample * count
    index = dr.minimum(mi.UInt32(scaled), count - 1)
    return index, scaled - mi.Float(index)
