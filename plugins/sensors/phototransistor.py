"""A rectangular light-sensitive area that reads optical power."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar, Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import make_plugin
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.carriers import faces_on, window_on
from mitsuba_taxel.kernels.paths.recorded_paths import RecordedPaths
from mitsuba_taxel.kernels.tables import Interpolant, read_angular_table, refine
from mitsuba_taxel.kernels.taxels import emission
from mitsuba_taxel.kernels.taxels.faces import FaceGrid
from mitsuba_taxel.kernels.taxels.windows import Window, transmittance
from mitsuba_taxel.specification.phototransistor import Phototransistor as Parameters

if TYPE_CHECKING:
    from mitsuba_taxel.kernels.paths.emission_guiding import GuidedEmission
    from mitsuba_taxel.kernels.paths.guide import Guide
    from mitsuba_taxel.kernels.paths.plane_mirrors import PlaneMirrors
    from mitsuba_taxel.kernels.scene_state import KnownScene

MOST_PIXELS = 1 << 24
"""Most pixels of a film, summed over all blocks."""
SMALLEST_COSINE = 1e-6
"""Least cosine by which the values of a table, which include the cosine, are divided."""

_E_OVER_HC = 1.602176634e-19 / (6.62607015e-34 * 299792458) * 1e-9  # A/W per nm, from the exact constants of the SI


class Phototransistor(mi.Sensor):
    r"""
    .. _sensor-phototransistor:

    Phototransistor (:monosp:`phototransistor`)
    -------------------------------------------

    Nest this sensor in a `rectangle`, at whose centre it lies, or in a `photo_reflector`. Pixels of its film are
    irradiance in W/mm². For an array the film has a block of pixels for each phototransistor, row by row; a reading is
    the mean of its block times the area.

    A reading is *effective* power in W: light is weighted by the response relative to that of an ideal
    phototransistor, which is 1 on the axis. The reading times :monosp:`responsivity(wavelength_nm)`, in A/W, is a
    current. The name of a table file is relative to the scene's XML file.

    Mitsuba merges sensors with identical parameters. To load a scene with two such sensors by :monosp:`mi.load_file` or
    :monosp:`mi.load_dict`, pass :monosp:`optimize=False`. `Scene.load` needs no such option.

    .. tabs::
        .. code-tab:: xml

            <shape type="rectangle">
                <sensor type="phototransistor">
                    <string name="response" value="cosine_power"/> <float name="exponent" value="2"/>
                </sensor>
            </shape>

        .. code-tab:: python

            'type': 'phototransistor', 'response': 'cosine_power', 'exponent': 2
    """

    LEARNED: ClassVar = ("guided_emission", "guide", "plane_mirrors", "recorded", "checked")
    """Attributes that are derived from the state of the scene, and are not part of that state."""

    def __init__(self, props: mi.Properties) -> None:
        parameters = Parameters.read(props)
        kinds = [type(value) for _, value in props.objects()]
        if not any(issubclass(kind, mi.Film) for kind in kinds):
            pixels = {"width": 1, "height": 1, "pixel_format": "luminance", "component_format": "float32"}
            props["film"] = make_plugin("hdrfilm", rfilter=make_plugin("box"), **pixels)
        if not any(issubclass(kind, mi.Sampler) for kind in kinds):
            props["sampler"] = make_plugin("owen_sobol", sample_count=1024)
        super().__init__(props)
        self.specification = parameters
        self.angular_response = _response_of(self.specification)
        self.table = self.angular_response.table if isinstance(self.angular_response, _Tabulated) else None
        self.view = self.angular_response.view
        if not self.film().rfilter().is_box_filter():
            raise InputError("film: its rfilter must be a box, so that the map integrates to the reading.")
        # A film reveals its pixel format only in its description.
        if "pixel_format = xyz" in str(self.film()):
            raise InputError("film: pixel_format = 'xyz' is not allowed: a reading has no colour; use luminance.")
        if tuple(self.film().crop_size()) != tuple(self.film().size()):
            raise InputError("film: a crop is not allowed, as the reading would be incomplete: remove it.")
        self.block = tuple(int(n) for n in self.film().size())
        self._check_film(1)
        self.m_needs_sample_3 = True
        self.resin_index: mi.Float | None = None
        self._faces: FaceGrid | None = None
        self.guided_emission: GuidedEmission | None = None  # learned by pilot runs
        self.guide: tuple[np.ndarray, Guide | None] | None = None
        self.plane_mirrors: tuple[np.ndarray, PlaneMirrors | None] | None = None
        self.recorded = RecordedPaths()
        self.checked: KnownScene | None = None

    def spread_film(self, rows: int, columns: int) -> None:
        """Enlarge the film to a block of pixels for each phototransistor of an array; raises `InputError`."""
        self._check_film(rows * columns)
        parameters = mi.traverse(self.film())
        parameters["size"] = mi.ScalarVector2u(columns * self.block[0], rows * self.block[1])
        parameters.update()

    def _check_film(self, blocks: int) -> None:
        width, height = self.block
        if not 0 < blocks * width * height <= MOST_PIXELS:
            raise InputError(
                f"film: {width} x {height} pixels for each of {blocks} phototransistors are not allowed: a total from "
                f"1 to {MOST_PIXELS} is needed."
            )

    def responsivity(self, wavelength_nm: float) -> float:
        """Photocurrent per effective power [A/W]: R = eta e lambda / (h c).

        Source: section 2.1.1 of Multiphysics Simulation for the Optimization of an Optoelectronic-Based Tactile
        Sensor, with the exact constants of the SI.

        Parameters
        ----------
        wavelength_nm : float
            In nm.

        Returns
        -------
        float
            In A/W.

        Raises
        ------
        InputError
            if the wavelength is not a finite number above 0.
        """
        if not 0 < wavelength_nm < math.inf:
            raise InputError(f"wavelength_nm = {wavelength_nm:g} is not allowed: a finite number above 0 is needed.")
        return self.specification.quantum_efficiency * _E_OVER_HC * wavelength_nm

    # Interface of `taxel_tracer`: one phototransistor at a time

    @property
    def faces(self) -> FaceGrid:
        """Positions of the phototransistors, computed at first use: the sensor gets its shape after construction."""
        if self._faces is None:
            size = self.specification.width, self.specification.depth
            self._faces = faces_on(self.get_shape(), "phototransistor", size)
            self._window = window_on(self.get_shape(), "phototransistor", self._faces)
        return self._faces

    @property
    def window(self) -> Window:
        """The windows above the phototransistors."""
        assert self.faces  # computes the windows as well
        return self._window

    @property
    def normal(self) -> mi.Vector3f:
        """Normal of the light-sensitive side."""
        return self.faces.frame.n

    def response(self, cosine: mi.Float) -> mi.Float:
        """Response to light relative to the ideal response, by the cosine (0, 1] of its angle to the normal.

        This is the response to a parallel beam divided by the cosine: 1 on the axis, and 1 for all angles if ideal.
        Below a window it includes the transmittance.
        """
        value = self.angular_response(cosine)
        return value if self.resin_index is None else value * transmittance(self.resin_index, cosine)

    def sample_view(self, sample: mi.Point2f) -> tuple[mi.Vector3f, mi.Float]:
        """A random direction in the frame of the normal, and its density [1/sr].

        Directions are distributed as the response to a parallel beam, so that a narrow response samples a small area of
        a wall.
        """
        local = self.view.sample(sample)
        return local, self.view.density(local)

    def density_of_view(self, d: mi.Vector3f) -> mi.Float:
        """Density [1/sr] of :meth:`sample_view` at a direction in world coordinates."""
        return self.view.density(self.faces.frame.to_local(d))

    def sample_point(self, index: mi.UInt32, sample: mi.Point2f) -> tuple[mi.Point3f, mi.Point2f]:
        """A uniformly distributed point on phototransistor ``index``, and its offset from the centre."""
        offset = (sample - 0.5) * self.faces.size
        return self.faces.point(index, offset), offset

    def contains(self, index: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Bool, mi.Point2f]:
        """Whether a ray in direction ``d`` through the surface point ``p`` meets phototransistor ``index``, and the
        offset of that hit from the centre."""
        offset, enters = self.window.enter(index, p, d)
        return dr.all(dr.abs(offset) <= 0.5 * self.faces.size) & enters, offset

    def pixel(self, index: mi.UInt32, offset: mi.Point2f) -> mi.Point2f:
        """Position on the film, in pixels, of a point on phototransistor ``index``."""
        faces = self.faces
        uv = dr.clip(mi.Point2f(offset.x, -offset.y) / faces.size + 0.5, 0, dr.one_minus_epsilon(mi.Float))
        row = index // faces.columns
        corner = mi.Point2f(mi.Float(index - row * faces.columns), mi.Float(row))
        return (corner + uv) * mi.Vector2f(*self.block)

    # Interface of the integrators of Mitsuba

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        faces = self.faces
        x, y = sample2.x * faces.columns, sample2.y * faces.rows
        column = dr.minimum(mi.UInt32(x), faces.columns - 1)
        row = dr.minimum(mi.UInt32(y), faces.rows - 1)
        offset = mi.Point2f(x - mi.Float(column) - 0.5, 0.5 - (y - mi.Float(row))) * faces.size
        index = row * faces.columns + column
        local, density = self.sample_view(sample3)
        d = faces.frame.to_world(local)
        ps = dr.zeros(mi.PositionSample3f)
        ps.p, is_open = self.window.leave(index, faces.point(index, offset), d)
        ps.n = self.normal
        ps.time = time
        si = mi.SurfaceInteraction3f(ps, dr.zeros(mi.Color0f))
        weight = self.response(local.z) * local.z / density
        return si.spawn_ray(d), mi.Spectrum(weight) & (active & is_open & (density > 0))

    def sample_ray_differential(self, time, sample1, sample2, sample3, active=True):
        ray, weight = self.sample_ray(time, sample1, sample2, sample3, active)
        return mi.RayDifferential3f(ray), weight

    def sample_direction(self, it, sample, active=True):
        faces = self.faces
        scaled = sample.x * faces.count
        index = dr.minimum(mi.UInt32(scaled), faces.count - 1)
        y, offset = self.sample_point(index, mi.Point2f(scaled - mi.Float(index), sample.y))
        sight = self.window.sight(index, it.p, y)
        ds = dr.zeros(mi.DirectionSample3f)
        ds.p, ds.d, ds.dist = sight.crossing, sight.direction, dr.norm(sight.crossing - it.p)
        ds.n = self.normal
        ds.uv = self.pixel(index, offset)
        ds.time = it.time
        cos_theta = -dr.dot(ds.d, ds.n)
        active &= (cos_theta > 0) & sight.is_open
        area = faces.count * faces.area
        ds.pdf = dr.select(active, sight.squared_distance / (cos_theta * area), 0)
        return ds, mi.Spectrum(dr.select(active, self.response(cos_theta) / (ds.pdf * area), 0))

    def pdf_direction(self, it, ds, active=True):
        cos_theta = -dr.dot(ds.d, ds.n)
        squared_distance = self.window.apparent(dr.square(ds.dist), cos_theta)
        value = squared_distance / (cos_theta * self.faces.count * self.faces.area)
        return dr.select(active & (cos_theta > 0), value, 0)

    def eval(self, si, active=True):
        cos_theta = dr.dot(si.to_world(si.wi), self.normal)
        value = self.response(cos_theta) / (self.faces.count * self.faces.area)
        return mi.Spectrum(value) & (active & (cos_theta > 0))

    def bbox(self):
        return self.get_shape().bbox()

    def parameters_changed(self, keys=()) -> None:
        self._faces = None  # the rectangle that carries it may have been moved

    def to_string(self) -> str:
        return f"Phototransistor[width = {self.specification.width:g}, depth = {self.specification.depth:g}]"


class _AngularResponse(Protocol):
    """Response relative to an ideal phototransistor, by the cosine of the angle; finite for every cosine up to 1.

    ``view`` is the distribution of directions that is proportional to the response to a parallel beam.
    """

    @property
    def view(self) -> emission.EmissionLaw: ...
    def __call__(self, cosine: mi.Float) -> mi.Float: ...


class _Ideal:
    """Response of an ideal phototransistor, which does not depend on the angle."""

    view = emission.CosineLaw()

    def __call__(self, cosine: mi.Float) -> mi.Float:
        return mi.Float(1)


class _CosinePower:
    """The response cos(theta)**(exponent - 1)."""

    def __init__(self, exponent: float) -> None:
        self.excess = dr.opaque(mi.Float, exponent - 1)
        self.view = emission.CosinePower(exponent)

    def __call__(self, cosine: mi.Float) -> mi.Float:
        return dr.power(dr.clip(cosine, 1e-30, 1), self.excess)


class _Tabulated:
    """Response from a table. The cosine is limited from below, because a table may not be zero at 90 degrees."""

    def __init__(self, angles: np.ndarray, responses: np.ndarray) -> None:
        self.view = emission.Tabulated(angles, responses)
        angles, responses = refine(angles, responses / responses[0])
        self.to_beam = Interpolant(np.radians(angles), responses)
        cosines = np.cos(np.radians(angles[::-1]))
        relative = responses[::-1] / np.maximum(cosines, SMALLEST_COSINE)
        if cosines[0] < SMALLEST_COSINE and responses[-1] == 0:
            relative[0] = relative[1]  # limit at 90 degrees
        self.table = cosines, relative

    def __call__(self, cosine: mi.Float) -> mi.Float:
        return self.to_beam(dr.safe_acos(cosine)) / dr.maximum(cosine, SMALLEST_COSINE)


def _response_of(parameters: Parameters) -> _AngularResponse:
    """The response of a phototransistor; raises `InputError` for a table that is not allowed."""
    if parameters.exponent is not None:
        return _CosinePower(parameters.exponent)
    if parameters.file is None:
        return _Ideal()
    angles, responses = read_angular_table(parameters.file)
    smallest = 1e-6 * responses.max()
    if responses[0] < smallest or responses[0] == 0:
        raise InputError(
            f"file = {parameters.file!r}: the value {responses[0]:g} at 0 degrees is not allowed: above 0, and at "
            f"least a millionth of the largest, {smallest:g}, is needed."
        )
    return _Tabulated(angles, responses)
