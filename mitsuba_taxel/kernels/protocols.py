"""Interfaces of the plugins of this package, and predicates that identify them.

Plugins of this package have an attribute ``specification`` with their parameters, which also names the plugin.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard

import mitsuba as mi

if TYPE_CHECKING:
    import numpy as np

    from mitsuba_taxel.kernels.surfaces.cell_surface import CellSurface
    from mitsuba_taxel.kernels.surfaces.mesh_adapter import Places
    from mitsuba_taxel.kernels.surfaces.reflectance import ReflectanceTable
    from mitsuba_taxel.kernels.surfaces.scattering import Scattering
    from mitsuba_taxel.kernels.taxels.faces import FaceGrid
    from mitsuba_taxel.kernels.taxels.windows import Window
    from mitsuba_taxel.mechanics.continuation.state import State
    from mitsuba_taxel.mechanics.elements.loads import Load
    from mitsuba_taxel.mechanics.errors.second_state import SecondState
    from mitsuba_taxel.mechanics.materials.laws import Material
    from mitsuba_taxel.mechanics.materials.mullins import Mullins
    from mitsuba_taxel.mechanics.surface.finish import Finish
    from mitsuba_taxel.mechanics.surface.tessellation import Surface
    from mitsuba_taxel.mechanics.surface.wall_finishes import SeparateFinish
    from mitsuba_taxel.pads import AnyPad
    from mitsuba_taxel.parts import Side
    from mitsuba_taxel.specification.annular_led import AnnularLed
    from mitsuba_taxel.specification.deformable_pad import DeformablePad
    from mitsuba_taxel.specification.phototransistor import Phototransistor
    from mitsuba_taxel.specification.specification import Specification
    from mitsuba_taxel.specification.wall import Wall
    from mitsuba_taxel.specification.wall_materials import WallMaterial

NO_ROOM = "cell = 'none' is not allowed with photo-reflectors, for which a block has no room"
"""Beginning of the refusal of readings of a pad without cells."""
AWAITED_PACKAGE = "awaited_package"
"""Property of a `deformable_pad` whose packages are built after the pad. With `self_contact` the pad stays undeformed
until ``heed`` is called. The value is a `mi.Properties`, which a scene file cannot contain."""


class TaxelEnd(Protocol):
    """Common interface of LEDs (`annular_led`) and `phototransistor`: the two ends of a taxel's light paths.

    ``resin_index`` is the refractive index of the resin in the windows above the dies, None without windows. ``table``
    is the table of the directional law, None for a formula: increasing cosines, and fraction of the power per solid
    angle or response relative to an ideal phototransistor.
    """

    resin_index: mi.Float | None
    table: tuple[np.ndarray, np.ndarray] | None

    @property
    def specification(self) -> Specification: ...
    @property
    def faces(self) -> FaceGrid: ...
    @property
    def window(self) -> Window: ...
    def get_shape(self) -> mi.Shape: ...


class LedEmitter(TaxelEnd, Protocol):
    """Interface of the plugin `annular_led`: one LED, or an array of LEDs."""

    specification: AnnularLed
    power: mi.Float
    wavelength: float

    @property
    def area(self) -> mi.Float: ...
    def sample_point(self, index: mi.UInt32, sample: mi.Point2f) -> mi.Point3f: ...
    def sample_direction_of_emission(self, sample: mi.Point2f) -> mi.Vector3f: ...
    def density_of_direction(self, d: mi.Vector3f) -> mi.Float: ...
    def emitted_fraction(self, d: mi.Vector3f) -> mi.Float: ...
    def leave(self, index: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point3f, mi.Float]: ...
    def contains(self, index: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> mi.Bool: ...


class PhototransistorSensor(TaxelEnd, Protocol):
    """Interface of the plugin `phototransistor`: one phototransistor, or an array of them.

    It also caches properties of its scene, which are None until they are computed: ``guided_emission`` is a
    `GuidedEmission`; ``guide`` is the vertices of a mesh and the `Guide` for these, or None if a guide does not reduce
    the error; ``plane_mirrors`` is the vertices of a mesh and the `PlaneMirrors` for these, or None; ``recorded`` is
    the `RecordedPaths`; ``checked`` is the `KnownScene` of the last check.
    """

    specification: Phototransistor
    guided_emission: Any
    guide: tuple[np.ndarray, Any] | None
    plane_mirrors: tuple[np.ndarray, Any] | None
    recorded: Any
    checked: Any

    @property
    def normal(self) -> mi.Vector3f: ...
    def film(self) -> mi.Film: ...
    def sampler(self) -> mi.Sampler: ...
    def spread_film(self, rows: int, columns: int) -> None: ...
    def responsivity(self, wavelength_nm: float) -> float: ...
    def response(self, cosine: mi.Float) -> mi.Float: ...
    def sample_view(self, sample: mi.Point2f) -> tuple[mi.Vector3f, mi.Float]: ...
    def density_of_view(self, d: mi.Vector3f) -> mi.Float: ...
    def sample_point(self, index: mi.UInt32, sample: mi.Point2f) -> tuple[mi.Point3f, mi.Point2f]: ...
    def contains(self, index: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Bool, mi.Point2f]: ...
    def pixel(self, index: mi.UInt32, offset: mi.Point2f) -> mi.Point2f: ...


class PackageShape(Protocol):
    """Interface of the plugin `photo_reflector`: the extent of its ``body``, its dies and windows ``sides`` by name,
    and the refractive index of the resin above the dies (None for dies in the top of the body)."""

    body: np.ndarray
    sides: dict[str, Side]
    resin_index: float | None

    def face_grid(self, name: str) -> FaceGrid: ...
    def window(self, name: str, dies: FaceGrid) -> Window | None: ...
    def is_as_built(self) -> bool: ...


class PadShape(Protocol):
    """Interface of the plugin `deformable_pad`: the undeformed ``pad``, the ``value`` of its load and its ``history``
    (times and values, the current ones last), ``state`` and ``surface`` under the load, and the codes of the regions
    that are ``mirrors``."""

    specification: DeformablePad
    pad: AnyPad
    material: Material
    load: Load
    value: Sequence[float]
    history: tuple[list[float], list[tuple[float, ...]]]
    prony: tuple[tuple[float, float], ...]
    mullins: Mullins | None
    mesh_size: float | None
    mesh_tolerance: float | None
    finish: Finish | SeparateFinish | None
    read_cells: Sequence[int] | None
    remembers: bool
    state: State
    surface: Surface
    mirrors: list[int]
    contact_pressure: np.ndarray | None
    to_world: np.ndarray
    ptr: int

    @property
    def undeformed(self) -> CellSurface: ...
    def bsdf(self) -> mi.BSDF: ...
    def face_count(self) -> int: ...
    def eval_attribute_1(self, name: str, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Float: ...
    def closed(self) -> mi.Mesh: ...
    def chords(self) -> Places: ...
    def blunt_heights(self) -> Places | None: ...
    def changing_region(self) -> np.ndarray | None: ...
    def deviating_places(self, fraction: float = 1.0) -> list[Places] | None: ...
    def curvature_errors(self, displacement: np.ndarray) -> np.ndarray: ...
    def moved_places(
        self, state: State, pad: AnyPad, chords: bool = False, curvature: np.ndarray | None = None
    ) -> Places: ...
    @property
    def is_loaded(self) -> bool: ...
    @property
    def is_curved(self) -> bool: ...
    @property
    def loaded_mesh_size(self) -> float | None: ...
    def at_onset(self) -> State: ...
    def state_under(self, value: Sequence[float], obstacles: np.ndarray | None = None) -> State: ...
    def heed(self, obstacles: np.ndarray) -> bool: ...
    def take(self, state: State) -> None: ...
    def second_state(self) -> SecondState | None: ...


class RegionBsdf(Protocol):
    """Interface of the plugin `region`: a BSDF for each region of a surface, by the name of the region.
    ``without_cells`` is true if they were named as those of a pad without cells."""

    walls: Mapping[str, mi.BSDF]
    without_cells: bool


class WallBsdf(Protocol):
    """Interface of the plugin `wall`, with the name of its ``scattering`` law. ``is_directed`` is true if the law has a
    specular or glossy component; ``reflectance`` is None until the wavelength for its ``table`` is set."""

    specification: Wall
    scattering: str
    is_directed: bool
    reflectance: mi.Float | None
    table: ReflectanceTable | WallMaterial | None
    law: Scattering

    @property
    def needs_wavelength(self) -> bool: ...
    def set_wavelength(self, nm: float) -> None: ...


def is_led(emitter: mi.Emitter) -> TypeGuard[LedEmitter]:
    """Whether an emitter is an `annular_led`.

    Parameters
    ----------
    emitter : mi.Emitter
        Any emitter.

    Returns
    -------
    bool
        True for a plugin of this package with that name.
    """
    return plugin_of(emitter) == "annular_led"


def is_phototransistor(sensor: mi.Sensor) -> TypeGuard[PhototransistorSensor]:
    """Whether a sensor is a `phototransistor`.

    Parameters
    ----------
    sensor : mi.Sensor
        Any sensor.

    Returns
    -------
    bool
        True for a plugin of this package with that name.
    """
    return plugin_of(sensor) == "phototransistor"


def has_faces(end: mi.Endpoint) -> TypeGuard[TaxelEnd]:
    """Whether an endpoint is an `annular_led` or a `phototransistor`.

    Parameters
    ----------
    end : mi.Endpoint
        Any emitter or sensor.

    Returns
    -------
    bool
        True for a plugin of this package with one of these names.
    """
    return is_led(end) or is_phototransistor(end)


def is_package(shape: mi.Shape) -> TypeGuard[PackageShape]:
    """Whether a shape is a `photo_reflector`.

    Parameters
    ----------
    shape : mi.Shape
        Any shape.

    Returns
    -------
    bool
        True for a plugin of this package with that name.
    """
    return plugin_of(shape) == "photo_reflector"


def is_pad(shape: mi.Shape) -> TypeGuard[PadShape]:
    """Whether a shape is a `deformable_pad`.

    Parameters
    ----------
    shape : mi.Shape
        Any shape.

    Returns
    -------
    bool
        True for a plugin of this package with that name.
    """
    return plugin_of(shape) == "deformable_pad"


def is_region(bsdf: mi.BSDF) -> TypeGuard[RegionBsdf]:
    """Whether a BSDF is a `region`.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any BSDF.

    Returns
    -------
    bool
        True for a plugin of this package with that name.
    """
    return plugin_of(bsdf) == "region"


def is_wall(bsdf: mi.BSDF) -> TypeGuard[WallBsdf]:
    """Whether a BSDF is a `wall`.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any BSDF.

    Returns
    -------
    bool
        True for a plugin of this package with that name.
    """
    return plugin_of(bsdf) == "wall"


def is_owen_sobol(sampler: mi.Sampler) -> bool:
    """Whether a sampler is an `owen_sobol`.

    Parameters
    ----------
    sampler : mi.Sampler
        Any sampler.

    Returns
    -------
    bool
        True for a plugin of this package with that name.
    """
    return plugin_of(sampler) == "owen_sobol"


def plugin_of(made: mi.Object) -> str | None:
    """Name of the plugin of this package that made an object; None for any other object."""
    return getattr(getattr(made, "specification", None), "plugin", None)
