"""A rectangular light-sensitive area that reads optical power."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.faces import FaceGrid, faces_on
from mitsuba_taxel.optics.parameters import number
from mitsuba_taxel.optics.parts import make_plugin


class Phototransistor(mi.Sensor):
    r"""
    .. _sensor-phototransistor:

    Phototransistor (:monosp:`phototransistor`)
    -------------------------------------------

    .. pluginparameters::

     * - width
       - |float|
       - Extent of the light-sensitive area along x, in mm. (Default: 0.52)

     * - depth
       - |float|
       - Extent along y, in mm. (Default: 0.3)

     * - film
       - |film|
       - One phototransistor's irradiance map; it must have a box filter. (Default: one pixel)

     * - sampler
       - |sampler|
       - Where the random numbers come from. (Default: :monosp:`owen_sobol`)

    Nest it in a `rectangle`, at whose centre it lies, or in a `photo_reflector`. A pixel of its film is irradiance
    in W/mm²; with several phototransistors the film holds one block of pixels for each, row by row, and a reading
    is the mean of its block times the area.

    Mitsuba merges sensors that are the same in every parameter: to load a scene that holds two such sensors with
    :monosp:`mi.load_file` or :monosp:`mi.load_dict`, pass :monosp:`optimize=False`. `Scene.load` needs nothing.

    .. tabs::
        .. code-tab:: xml

            <shape type="rectangle">
                <sensor type="phototransistor"> <float name="width" value="0.3"/> </sensor>
            </shape>

        .. code-tab:: python

            'type': 'phototransistor', 'width': 0.3
    """

    def __init__(self, props: mi.Properties) -> None:
        kinds = [type(value) for _, value in props.objects()]
        if not any(issubclass(kind, mi.Film) for kind in kinds):
            pixels = {"width": 1, "height": 1, "pixel_format": "luminance", "component_format": "float32"}
            props["film"] = make_plugin("hdrfilm", rfilter=make_plugin("box"), **pixels)
        if not any(issubclass(kind, mi.Sampler) for kind in kinds):
            props["sampler"] = make_plugin("owen_sobol", sample_count=1024)
        super().__init__(props)
        self.width = number(props, "width", 0.52, above=0)
        self.depth = number(props, "depth", 0.3, above=0)
        if self.film().rfilter().radius() > 0.5 + 1e-3:
            raise InputError("film: its rfilter must be a box, so that the map integrates to the reading.")
        self.block = tuple(int(n) for n in self.film().size())
        self.m_needs_sample_3 = True
        self._faces: FaceGrid | None = None

    def spread_film(self, rows: int, columns: int) -> None:
        """Give the film one block of pixels for each phototransistor of an array."""
        parameters = mi.traverse(self.film())
        parameters["size"] = mi.ScalarVector2u(columns * self.block[0], rows * self.block[1])
        parameters.update()

    # What `taxel_tracer` asks: one phototransistor at a time

    @property
    def faces(self) -> FaceGrid:
        """Where the phototransistors are; found when first asked for, since the shape adopts its sensor late."""
        if self._faces is None:
            self._faces = faces_on(self.get_shape(), "phototransistor", (self.width, self.depth))
        return self._faces

    @property
    def normal(self) -> mi.Vector3f:
        """The direction in which the light-sensitive side looks."""
        return self.faces.frame.n

    def sample_point(self, index: mi.UInt32, sample: mi.Point2f) -> tuple[mi.Point3f, mi.Point2f]:
        """A point uniform on phototransistor ``index``, and its offset from the centre."""
        offset = (sample - 0.5) * self.faces.size
        return self.faces.point(index, offset), offset

    def contains(self, index: mi.UInt32, p: mi.Point3f) -> tuple[mi.Bool, mi.Point2f]:
        """Whether the surface point ``p`` lies on phototransistor ``index``, and its offset from the centre."""
        nearest, offset = self.faces.locate(p)
        height = dr.abs(self.faces.frame.to_local(p - self.faces.origin).z)
        within = dr.all(dr.abs(offset) <= 0.5 * self.faces.size) & (height <= 1e-3 * self.faces.size.y)
        return within & (nearest == index), offset

    def pixel(self, index: mi.UInt32, offset: mi.Point2f) -> mi.Point2f:
        """Film position in pixels of a point on phototransistor ``index``."""
        faces = self.faces
        uv = dr.clip(mi.Point2f(offset.x, -offset.y) / faces.size + 0.5, 0, dr.one_minus_epsilon(mi.Float))
        row = index // faces.columns
        corner = mi.Point2f(mi.Float(index - row * faces.columns), mi.Float(row))
        return (corner + uv) * mi.Vector2f(*self.block)

    # What Mitsuba's own integrators ask

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        faces = self.faces
        x, y = sample2.x * faces.columns, sample2.y * faces.rows
        column = dr.minimum(mi.UInt32(x), faces.columns - 1)
        row = dr.minimum(mi.UInt32(y), faces.rows - 1)
        offset = mi.Point2f(x - mi.Float(column) - 0.5, 0.5 - (y - mi.Float(row))) * faces.size
        ps = dr.zeros(mi.PositionSample3f)
        ps.p = faces.point(row * faces.columns + column, offset)
        ps.n = self.normal
        ps.time = time
        si = mi.SurfaceInteraction3f(ps, dr.zeros(mi.Color0f))
        ray = si.spawn_ray(faces.frame.to_world(mi.warp.square_to_cosine_hemisphere(sample3)))
        return ray, mi.Spectrum(dr.pi) & active

    def sample_ray_differential(self, time, sample1, sample2, sample3, active=True):
        ray, weight = self.sample_ray(time, sample1, sample2, sample3, active)
        return mi.RayDifferential3f(ray), weight

    def sample_direction(self, it, sample, active=True):
        faces = self.faces
        scaled = sample.x * faces.count
        index = dr.minimum(mi.UInt32(scaled), faces.count - 1)
        ds = dr.zeros(mi.DirectionSample3f)
        ds.p, offset = self.sample_point(index, mi.Point2f(scaled - mi.Float(index), sample.y))
        ds.n = self.normal
        ds.uv = self.pixel(index, offset)
        ds.time = it.time
        ds.d = ds.p - it.p
        distance_squared = dr.squared_norm(ds.d)
        ds.dist = dr.sqrt(distance_squared)
        ds.d /= ds.dist
        cos_theta = -dr.dot(ds.d, ds.n)
        active &= cos_theta > 0
        area = faces.count * faces.area
        ds.pdf = dr.select(active, distance_squared / (cos_theta * area), 0)
        return ds, mi.Spectrum(dr.select(active, dr.rcp(ds.pdf * area), 0))

    def pdf_direction(self, it, ds, active=True):
        cos_theta = -dr.dot(ds.d, ds.n)
        return dr.select(
            active & (cos_theta > 0), dr.square(ds.dist) / (cos_theta * self.faces.count * self.faces.area), 0
        )

    def eval(self, si, active=True):
        return mi.Spectrum(dr.rcp(self.faces.count * self.faces.area)) & active

    def bbox(self):
        return self.get_shape().bbox()

    def to_string(self) -> str:
        return f"Phototransistor[width = {self.width:g}, depth = {self.depth:g}]"
